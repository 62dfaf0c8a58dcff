"""Hostile nodes: each costs its own run alone, with a true sentence, and leaves nothing running."""

import json
import re
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.sim.ros.scripts import DRIVE, HEAD, node

from limo_hog.cli.main import main
from limo_sim.ros import runner, worker
from limo_sim.ros.lockstep.records import Shown, StubError
from limo_sim.ros.runner import Limits
from limo_sim.workshop.check import examine
from limo_sim.workshop.exercises import scene_named
from limo_sim.workshop.report import total
from limo_sim.workshop.takes import Take

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what a node leaves is found by Linux's /proc")

LIMITS = Limits(patience=4.0, seconds=40.0, memory_mb=3000, printed_mb=5)
FOREVER = "while True:\n    try:\n        n = range(99)\n        while True: sum(n)\n    except BaseException: pass"
LINK = "import gc\nlink = next(o for o in gc.get_objects() if type(o).__name__ == 'SocketLink')"
SLEEP = "import subprocess; subprocess.Popen(['sleep', '98765'], start_new_session=True)"

#: What the third image makes each node do, and words of the sentence that says so; ⏎ begins a line.
TABLE = """
exit 0 | import os; os._exit(0) | died at 0.20 s: its process ended with status 0 before the run was over
exit 3 | import os; os._exit(3) | its process ended with status 3
exit in C | import ctypes; ctypes.CDLL(None)._exit(4) | its process ended with status 4
segfault | import ctypes; ctypes.string_at(0) | its process was ended by SIGSEGV
abort | import os; os.abort() | its process was ended by SIGABRT
kill | import os; os.kill(os.getpid(), 9) | its process was ended by SIGKILL
terminate | import os; os.kill(os.getpid(), 15) | its process was ended by SIGTERM
stop | import os, signal; os.kill(os.getpid(), signal.SIGSTOP) | no simulated time has passed
parent | import os; os.kill(os.getppid(), 9); import time⏎while True: pass | ended the process that watches
group | import os; os.killpg(0, 9) | ended the process that watches
sys.exit | import sys; sys.exit(5) | sys.exit(5)
loop | while True: pass | hung at 0.20 s: no simulated time has passed for 4 s
loop that catches all | FOREVER | it took no interrupt
loop in C | sum(range(10**12)) | hung at 0.20 s
ignored alarm | import signal; signal.signal(signal.SIGALRM, signal.SIG_IGN)⏎while True: pass | no interrupt
all signals blocked | import signal; signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 64))⏎while True: pass
    | it took no interrupt
pause | import signal; signal.pause() | hung at 0.20 s
standard input | input() | EOFError
lock | import _thread⏎a = _thread.allocate_lock(); a.acquire(); a.acquire() | hung at 0.20 s
printing | import os⏎while True: os.write(1, b'x' * 10**6) | more than 5 MB
printing errors | import sys⏎while True: sys.stderr.write('x' * 10**5) | more than 5 MB
logging | while True: self.get_logger().info('x' * 10**6) | more than 5 MB
windows | import cv2, numpy⏎for i in range(9999): cv2.imshow(str(i), numpy.zeros((2, 2), numpy.uint8))
    | more than 100 windows are open
commands | while True: self.pub.publish(Twist()) | without a step of the arena
memory | keep = bytearray(10 * 10**9) | MemoryError
memory bit by bit | import numpy⏎keep = []⏎while True: keep.append(numpy.zeros(10**7)) | MemoryError
recursion | f = lambda: f()⏎f() | RecursionError
closed descriptors | import os; os.closerange(0, 1000) | ied at 0.20 s
closed and hangs | import os; os.closerange(3, 1000)⏎while True: pass | closed its connection
text of an error | class Odd(Exception):⏎    def __str__(self): raise ValueError⏎raise Odd
    | its text cannot be read: __str__ raises ValueError
own base exception | class Odd(BaseException): pass⏎raise Odd('oh') | failed with Odd at 0.20 s: oh
interrupt | raise KeyboardInterrupt | failed with KeyboardInterrupt
not finite | t = Twist(); t.linear.x = float('nan'); self.pub.publish(t) | finite numbers alone
own file deleted | import os; os.unlink(__file__); 1 / 0 | ZeroDivisionError
folder deleted | import os, shutil⏎from pathlib import Path⏎here = Path(__file__).resolve().parent
    ⏎assert here.name == 'there' and list(here.iterdir()) == [here / 'node.py']⏎shutil.rmtree(here); 1 / 0
    | ZeroDivisionError
fork | import os⏎if os.fork() == 0:⏎    import time⏎    while True: pass⏎os._exit(1) | status 1
fork that goes on | import os⏎os.fork(); 1 / 0 | ZeroDivisionError
daemon | SLEEP; 1 / 0 | ZeroDivisionError
daemon of a fork | import os⏎if os.fork() == 0:⏎    os.setsid(); SLEEP; os._exit(0)⏎1 / 0 | ZeroDivision
thread that spins | import threading, time⏎def spin():⏎    while True: pass⏎threading.Thread(target=spin).start()
    ⏎time.sleep(0.1) | hung at 0.20 s
forged messages | LINK⏎link.tell('points', 100) | it sent what is no message of a node
a deep message | LINK⏎link._connection.sendall(bytes((160, 134, 1, 0, 0, 0, 0, 0)) + b'[' * 100000)
    | it sent what is no message of a node
"""
IN_A_CALLBACK: dict[str, tuple[str, str]] = {}
for row in re.sub(r"\n +(?=[|⏎])", " ", TABLE).replace(" ⏎", "⏎").strip().splitlines():
    named, body, said = row.split(" | ")
    for short, code in {"SLEEP": SLEEP, "FOREVER": FOREVER, "LINK": LINK, "⏎": "\n"}.items():
        body = body.replace(short, code)
    IN_A_CALLBACK[named] = body, said
#: The same as a file.
FILES = {
    "not Python": ("this is no Python", "SyntaxError"),
    "NUL": ("\0", "SyntaxError"),
    "deep": ("(" * 10_000, "SyntaxError"),
    "exit before all": ("import os; os._exit(0)", "died at 0.00 s: its process ended with status 0"),
    "catches all": (FOREVER, "it took no interrupt"),
    "patched judge": (
        "import limo_sim.workshop.check as c\nc.check = c.examine = lambda *a, **k: []\nimport os; os._exit(0)",
        "its process ended with status 0",
    ),
}
THEN = f"self.n = getattr(self, 'n', 0) + 1\nif self.n < 3:\n    {DRIVE}\n    return\n"
HOSTILE = {name: (HEAD + node(THEN + body), said) for name, (body, said) in IN_A_CALLBACK.items()} | FILES
#: Of these, those that are tried with every change; the others are marked slow.
QUICK = ("exit 0", "segfault", "daemon", "own file deleted", "forged messages", "memory", "ignored alarm")


def left_running() -> list[str]:
    """Return the commands of the processes that a node has left; those that wait for the next node are none."""
    waiting = {waits._process.pid for waits in worker.idle}
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) not in waiting:
            try:
                command = (entry / "cmdline").read_text(errors="replace").replace("\0", " ")
                parent = int((entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1])
            except OSError:
                continue
            if "98765" in command or parent in waiting:
                found.append(command)
    return found


@pytest.mark.parametrize("name", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in HOSTILE])
def test_a_hostile_node_leaves_nothing(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text, said = HOSTILE[name]
    monkeypatch.setattr(runner, "GRACE_S", 1.0)
    script = tmp_path / "there" / "node.py"
    script.parent.mkdir()
    script.write_text(text)
    began = time.monotonic()
    # (It runs in that folder, and in no other.)
    verdicts = examine(script, limits=replace(LIMITS, folder=script.parent)).verdicts
    assert verdicts[0].holds is False
    assert said in verdicts[0].evidence
    assert total(verdicts) == (0, 100)
    assert time.monotonic() - began < 60
    assert left_running() == []


def test_the_json_of_a_node_that_exits_is_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "node.py").write_text("print('{oh}', flush=True)\nimport os; os._exit(0)\n")
    assert main(["workshop", "check", str(tmp_path / "node.py"), "--json", "-"]) == 1
    said = capsys.readouterr()
    assert json.loads(said.out)["points"] == 0
    assert "its process ended with status 0" in said.out
    assert "{oh}" in said.err


def test_a_node_that_shows_pictures_without_end_is_stopped() -> None:
    take, shown = Take(scene_named("left")), Shown(0.0, np.zeros((480, 640, 3), np.uint8))
    for _ in range(100):
        take.shown("a", shown)
    with pytest.raises(ValueError, match="more than 92 MB of pictures a second"):
        take.shown("a", shown)


@pytest.fixture
def exits(tmp_path: Path) -> Path:
    (tmp_path / "node.py").write_text("raise SystemExit(3)\n")
    return tmp_path / "node.py"


def test_a_process_that_waited_for_a_node_and_was_killed_is_replaced(exits: Path) -> None:
    with worker.ready() as waiting:
        pass
    worker.idle.append(waiting)
    waiting.kill()
    assert "sys.exit(3)" in examine(exits, limits=LIMITS).verdicts[0].evidence


def test_a_process_that_was_told_to_leave_gets_no_other_node(exits: Path) -> None:
    for _ in range(5):
        examine(exits, limits=LIMITS)
        with worker.ready() as waiting, worker.no_nodes(), pytest.raises(StubError), worker.ready():
            pass
        assert waiting not in worker.idle
        assert "sys.exit(3)" in examine(exits, limits=LIMITS).verdicts[0].evidence


def test_the_line_of_a_crash_is_told(tmp_path: Path) -> None:
    script = tmp_path / "node.py"
    script.write_text("import os\n\nimport ctypes\nctypes.string_at(0)\n")
    assert examine(script, limits=LIMITS).verdicts[0].line == 4
    script.write_text("import os\n\nos._exit(2)\n")
    assert examine(script, limits=LIMITS).verdicts[0].line == 3
