"""What a camera frame takes on its way through `limo-hog run`: calls of functions, and copies of the image."""

import json
import socket
import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from tests.sim.ros.scripts import DRIVE, HEAD, STANDING, node, run_script

from limo_sim import workshop
from limo_sim.ros.runner import run_node
from limo_sim.ros.stage import Stage
from limo_sim.run.log import Step
from limo_sim.world.scenario import Scenario

ROOT = Path(__file__).parents[3]
OURS = tuple(str(ROOT / folder) for folder in ("python", "sim"))
#: Frames that are counted, and those before the first of them.
FRAMES, SKIPPED = 40, 20

#: Counts the calls in the node's process, from one image to another.
COUNTED = f"""
    def on_image(self, message):
        self.seen = getattr(self, "seen", 0) + 1
        if self.seen == {SKIPPED}:
            import collections, sys
            self.files = collections.Counter()

            def called(frame, event, _):
                if event == "call" and frame.f_code.co_filename.startswith({OURS}):
                    self.files[frame.f_code.co_filename] += 1

            sys.setprofile(called)
        elif self.seen == {SKIPPED + FRAMES}:
            import json, sys
            sys.setprofile(None)
            print(json.dumps(self.files))
"""


def test_a_frame_takes_few_calls_in_both_processes_together(tmp_path: Path) -> None:
    script, files, seen = tmp_path / "node.py", Counter[str](), list[float]()
    head = "\n    def on_image(self, message):\n"
    script.write_text(workshop.solution("follower").replace(head, COUNTED), encoding="utf-8")

    def called(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(OURS):
            files[frame.f_code.co_filename] += 1

    def watch(step: Step) -> None:
        if step.log.frame is not None:
            seen.append(step.log.time)
            if len(seen) == SKIPPED:
                sys.setprofile(called)
            elif len(seen) == SKIPPED + FRAMES:
                sys.setprofile(None)

    before = sys.getprofile()
    try:
        ended = run_script(script, Scenario.load("followable"), 7.0, 1, watch=watch)
    finally:
        sys.setprofile(before)
    assert ended.failure == ""
    there = Counter(json.loads(ended.printed["stdout"]))
    # 426 in 39 files; three more for each piece in which a picture comes, and a file where the node is waited for.
    assert files.total() + there.total() <= 450 * FRAMES
    assert len(files.keys() | there.keys()) <= 40


#: Prints by how many times the image's size the memory was greater on its way than at its end.
PEAK = f"""
{DRIVE}
import tracemalloc
if not tracemalloc.is_tracing():
    tracemalloc.start()
else:
    now, peak = tracemalloc.get_traced_memory()
    print((peak - now) / len(msg.data))
tracemalloc.reset_peak()
"""


def test_an_image_is_copied_once_on_its_way_to_the_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script, said, sent, real = tmp_path / "node.py", list[str](), list[bool](), socket.socket.sendall
    script.write_text(HEAD + node(PEAK), encoding="utf-8")
    stage = Stage(script, STANDING, 2.0)

    def sendall(end: socket.socket, data: Any) -> None:
        if len(data) == 640 * 480 * 3:
            sent.append(np.shares_memory(np.asarray(data), stage.arena.frame().image))
        real(end, data)

    # (The socket copies what the camera drew, not a copy of it, into what the node is given.)
    monkeypatch.setattr(socket.socket, "sendall", sendall)
    ended = run_node(stage, said=lambda name, text: said.append(text) if name == "stdout" else None)
    assert ended.failure == ""
    extra = [float(line) for line in "".join(said).split()]
    assert len(extra) >= 15 and max(extra) < 0.1
    assert len(sent) >= 15 and all(sent)
