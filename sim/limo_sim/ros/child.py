"""The process of a stranger's node: it holds the node and nothing that judges it.

`python -m limo_sim.ros.child` imports what nodes need, and waits for a job on its standard input. On Linux it then
forks: the copy runs the node, and this process, to which all that the node starts falls when its own parent ends, kills
what is left. Elsewhere it runs one node itself.
"""

from __future__ import annotations

import array
import base64
import contextlib
import faulthandler
import io
import json
import os
import select
import signal
import socket
import sys
from dataclasses import astuple
from pathlib import Path
from typing import Any

from limo_sim.ros.wire import FORKS, SocketLink, prctl

_SET_PDEATHSIG, _SET_CHILD_SUBREAPER = 1, 36
# While this process imports, nothing can be told to it: it ends with its parent, and by SIGTERM.
prctl(_SET_PDEATHSIG, signal.SIGKILL)

import limo_hog  # noqa: E402
from limo_hog import detector  # noqa: E402
from limo_hog.extras import needed  # noqa: E402
from limo_sim.ros.lockstep.world import World  # noqa: E402
from limo_sim.ros.offer import offered  # noqa: E402
from limo_sim.ros.script import run_script  # noqa: E402

with needed(by="limo-hog run"):
    import cv2
    import ruamel.yaml  # noqa: F401 — later, a file of the node's with this name would be found

#: How long a node that is stopped may take to say where it was [s].
_LAST_WORDS_S = 0.5


def _run(job: dict[str, Any], out: socket.socket, err: socket.socket, link: socket.socket) -> None:
    """Run a node; end the process."""
    leave = os._exit
    try:
        _limit(job["memory_mb"])
        os.chdir(job["folder"])
        os.environ.clear()
        os.environ.update(job["environment"])
        sys.stdin = Path(os.devnull).open(encoding="utf-8")  # noqa: SIM115 — the process's
        if os.name == "posix":
            for fd, end in ((0, sys.stdin), (1, out), (2, err)):
                os.dup2(end.fileno(), fd)
        faulthandler.enable(err.fileno(), all_threads=False)
        sys.stdout, sys.stderr = (
            io.TextIOWrapper(end.makefile("wb", 0), "utf-8", "replace", write_through=True) for end in (out, err)
        )
        way = SocketLink(link)
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=way.leave)
        world = World(way, job["seconds"], script=Path(job["script"]), patience=job["patience"], checked=job["checked"])
        if world.checked:
            # The same boxes as OpenCV's in all but a few of a thousand images, many times faster. (Levels of a coarser
            # pyramid are too different to guide each other.)
            vars(cv2)["HOGDescriptor"] = limo_hog.HOGDescriptor
            guide = detector.Guide(halvings=3, margin=1.0, reach=(2.0, 2.0))
            limo_hog.HOGDescriptor._guide = lambda _, scale: guide if 1.0 < scale < 1.06 else None
            detector._GUIDES["exact"] = detector._GUIDES["guided"]
            limo_hog.set_num_threads(1)

            def opened(event: str, arguments: tuple[Any, ...]) -> None:
                if event == "open" and str(arguments[0]).endswith(".solution.txt"):
                    way.tell("read", world.line())

            sys.addaudithook(opened)

        def told_exit(status: int) -> None:
            way.tell("exits", world.line())
            leave(status)

        os._exit = told_exit  # type: ignore[assignment]
        way.tell("ready")
        fault = run_script(world, job["arguments"])
        way.tell("ended", None if fault is None else astuple(fault))
    finally:
        # (Nor does a process that the node has forked get further.)
        leave(1)


def _limit(memory_mb: int) -> None:
    """Limit what the process may hold, where the system does (not on Windows); no file is left of a crash."""
    if os.name == "nt":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory_mb * 10**6, memory_mb * 10**6))


def _attend(node: int, control: socket.socket) -> int:
    """Wait until the node ends or is to end; end all that it started. Return its status, negative for a signal."""
    ended = os.pidfd_open(node)
    ready, _, _ = select.select([ended, control.fileno()], [], [])
    if ended not in ready:
        if control.recv(1) == b"w":
            # Where it was: the fault handler tells.
            os.kill(node, signal.SIGABRT)
            select.select([ended], [], [], _LAST_WORDS_S)
        os.kill(node, signal.SIGKILL)
    _, status = os.waitpid(node, 0)
    os.close(ended)
    while True:
        for child in _children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            return os.waitstatus_to_exitcode(status)


def _children() -> list[int]:
    """Return the processes whose parent is this one."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                # Behind the name in brackets: the state, and the parent.
                parent = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1]
            except OSError:
                continue
            if int(parent) == os.getpid():
                found.append(int(entry.name))
    return found


def _serve() -> None:
    """Wait for jobs, one after another."""
    control = socket.socket(fileno=os.dup(0))
    prctl(_SET_CHILD_SUBREAPER, 1)
    # From here on it ends what it has started before it ends itself.
    prctl(_SET_PDEATHSIG, 0)
    signal.signal(signal.SIGTERM, lambda *_: None)
    while True:
        text, fds, _, _ = socket.recv_fds(control, 1 << 20, 3)
        if not text:
            return
        # (What was to end a node that had just ended by itself.)
        text = text.lstrip(b"kw")
        if not text:
            continue
        ends = [socket.socket(fileno=fd) for fd in fds]
        node = os.fork()
        if node == 0:
            prctl(_SET_PDEATHSIG, signal.SIGKILL)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            control.close()
            _run(json.loads(text), *ends)
        for end in ends:
            end.close()
        control.sendall(array.array("i", [_attend(node, control)]).tobytes())


def _once() -> None:
    """Wait for one job, and do it."""
    if os.name == "nt":
        job = json.loads(sys.stdin.readline())
        ends = [socket.fromshare(base64.b64decode(share)) for share in job["shares"]]  # type: ignore[attr-defined]
    else:
        control = socket.socket(fileno=os.dup(0))
        text, fds, _, _ = socket.recv_fds(control, 1 << 20, 3)
        control.close()
        if not text:
            return
        job, ends = json.loads(text), [socket.socket(fileno=fd) for fd in fds]
    _run(job, *ends)


if __name__ == "__main__":
    # (`-m` puts the folder it was started in before all others.)
    del sys.path[0]
    offered()
    (_serve if FORKS else _once)()
