"""Runs a stranger's node in a process of its own, with limits, and ends it with all that it started.

The arena, the log and the judge are in this process. The node's tells what it does as plain data (see `stage`); however
it ends, there is a run that can be scored and a sentence that says why.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import select
import signal
import socket
import time
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from limo_hog.exceptions import LimoHogError
from limo_sim.ros.lockstep.records import Fault, StubError
from limo_sim.ros.stage import Ended, Stage
from limo_sim.ros.wire import HEAD, packed
from limo_sim.ros.worker import Worker, ready

#: A node that hangs is interrupted in its own process; where it takes no interrupt, the process is stopped so much
#: later [s]. Chosen: a busy computer may be late by a second or two.
GRACE_S = 5.0
#: How long the process may take to start [s]: it imports numpy, OpenCV and rosbags. Chosen for a slow disk.
_START_S = 120.0
#: How long a process whose connection is closed may take to end [s].
_END_S = 1.0
#: How often it is looked whether the process still lives, while it says nothing [s].
_LOOK_S = 0.2
#: Longest message [bytes]: a picture of 8000 x 8000 pixels.
_LONGEST = 200 * 10**6
#: How much of the end of a node's standard error is searched for the place of a crash [characters].
_TAIL = 20_000


@dataclass(frozen=True, slots=True)
class Limits:
    """What one node may use."""

    patience: float = 20.0  #: wall time without simulated time passing [s]
    seconds: float = 1e9  #: wall time [s]
    began: float | None = None  #: when that began, on `time.monotonic` [s]; None: with the run
    #: Address space [MB], where the system limits it (not on Windows). Python with OpenCV reserves 1.5 GB; chosen.
    memory_mb: int = 4000
    printed_mb: int = 50  #: what it may print and log [MB]
    folder: Path | None = None  #: where it runs; None for this process's folder


#: Is given what a node prints: "stdout" or "stderr", and the text.
Said = Callable[[str, str], None]


def run_node(
    stage: Stage,
    arguments: Sequence[str] = (),
    *,
    limits: Limits | None = None,
    said: Said = lambda *_: None,
    checked: bool = False,
) -> Ended:
    """Run the stage's script as `python SCRIPT ARGUMENTS` would, with the arena behind its topics.

    Of the arguments, what follows --ros-args is ROS's. `said` is given what the node prints. With `checked` the stage's
    witness is shown what detectors are given; limo-hog's HOG then stands in for OpenCV's: the same boxes in less time.
    Raises `StubError` if there is no such script.
    """
    if not stage.script.is_file():
        raise StubError(f"{stage.script}: no such file")
    with ready() as worker:
        run = _Run(stage, limits or Limits(), said, worker)
        try:
            run.begin(arguments, checked)
            fault = run.serve()
        finally:
            worker.end()
            run.close()
    return stage.finish(fault)


class _StoppedError(LimoHogError):
    """The node is over one of its limits, or sends what is no message."""


class _Run:
    """One run of a node: what it sends, and its limits."""

    def __init__(self, stage: Stage, limits: Limits, said: Said, worker: Worker) -> None:
        self._stage, self._limits, self._said, self._worker = stage, limits, said, worker
        self._printed = 0
        self._tail = ""
        self._pairs = [socket.socketpair() for _ in range(3)]
        #: Ours of the connections: what is printed, and the link, last; and those that are not closed yet.
        self._ends = [ours for ours, _ in self._pairs]
        self._open = self._ends.copy()
        decoder = codecs.getincrementaldecoder("utf-8")
        out, err, _ = self._ends
        self._texts = {out: ("stdout", decoder("replace")), err: ("stderr", decoder("replace"))}
        self._exits: int | None = None
        self._exited = False
        self._fault: Fault | None = None
        self._received = bytearray()

    def begin(self, arguments: Sequence[str], checked: bool) -> None:
        """Start the node."""
        theirs = [their for _, their in self._pairs]
        job = {
            "script": str(self._stage.script),
            "folder": str(self._limits.folder or Path.cwd()),
            "environment": dict(os.environ),
            "arguments": list(arguments),
            "seconds": self._stage.seconds,
            "patience": self._limits.patience,
            "memory_mb": self._limits.memory_mb,
            "checked": checked,
        }
        self._worker.begin(job, theirs)
        for end in theirs:
            end.close()
        began = self._limits.began
        self._over_at = (time.monotonic() if began is None else began) + self._limits.seconds
        self._wait_until = time.monotonic() + _START_S

    def close(self) -> None:
        """Close the connections, those of a node that could not be started as well."""
        for end in chain(*self._pairs):
            end.close()

    def serve(self) -> Fault | None:
        """Answer the node until it has ended; return why that was before its time, None if it was not."""
        link = self._ends[-1]
        link.settimeout(self._limits.patience + GRACE_S)
        try:
            while link in self._open:
                ready = self._take(_LOOK_S)
                if self._messages():
                    return self._fault
                self._check_limits()
                if not ready and not self._worker.alive:
                    break
        except _StoppedError as error:
            self._worker.end()
            return Fault("was stopped", str(error))
        except TimeoutError:
            self._worker.end(b"w")
            self._drain()
            patience = f"{self._limits.patience:g} s, and it took no interrupt"
            said = f"no simulated time has passed for {patience}: its process was stopped"
            return Fault("hung", said, line=self._place())
        left = self._worker.is_alone(_END_S)
        status = self._worker.end()
        self._drain()
        return self._death(status, left)

    def _death(self, status: int | None, by_itself: bool) -> Fault | None:
        """Say what became of a node whose link was closed before it had reported its end."""
        if status is None:
            return Fault("died", "it ended the process that watches it")
        if self._exited and status == 0 and self._stage.over:
            return None
        if not (self._exited or by_itself):
            return Fault("died", "it closed its connection to the arena: its process was stopped")
        if self._exited or status >= 0:
            said = f"its process ended with status {status} before the run was over, as by os._exit"
            return Fault("died", said, line=self._exits)
        try:
            name = signal.Signals(-status).name
        except ValueError:
            name = f"signal {-status}"
        return Fault("died", f"its process was ended by {name}", line=self._place())

    def _place(self) -> int | None:
        """Return the line of the script at which the fault handler found it; None where it did not."""
        script = re.escape(str(self._stage.script))
        found = re.search(rf'most recent call first\):\n(?:  File .*\n)*?  File "{script}", line (\d+)', self._tail)
        return None if found is None else int(found[1])

    def _take(self, seconds: float) -> bool:
        """Take what has been sent, and wait for it no longer than this [s]; return whether anything was."""
        # (What is printed before a message is there before it: `select` keeps the order.)
        ready, _, _ = select.select(self._open, [], [], seconds)
        for end in ready:
            try:
                data = end.recv(1 << 20)
            except ConnectionResetError:
                data = b""
            if not data:
                self._open.remove(end)
            elif end in self._texts:
                self._print(*self._texts[end], data)
            else:
                self._received += data
        return bool(ready)

    def _drain(self) -> None:
        """Take what is printed yet."""
        with suppress(_StoppedError):
            while self._open and self._take(0):
                pass

    def _print(self, name: str, decoder: codecs.IncrementalDecoder, data: bytes) -> None:
        text = decoder.decode(data)
        if name == "stderr":
            self._tail = (self._tail + text)[-_TAIL:]
        self._count(len(data))
        self._said(name, text)

    def _count(self, length: int) -> None:
        self._printed += length
        if self._printed > self._limits.printed_mb * 10**6:
            raise _StoppedError(f"it has printed and logged more than {self._limits.printed_mb} MB")

    def _check_limits(self) -> None:
        now = time.monotonic()
        if now > self._over_at:
            raise _StoppedError(f"it ran for more than {self._limits.seconds:g} s")
        if now > self._wait_until:
            raise TimeoutError

    def _messages(self) -> bool:
        """Take the whole messages of what was received; return whether the node has ended."""
        while len(self._received) >= HEAD.size:
            said, size = HEAD.unpack_from(self._received)
            if said + size > _LONGEST:
                raise _StoppedError(f"it sent a message of {said + size} bytes")
            whole = HEAD.size + said + size
            if len(self._received) < whole:
                return False
            with memoryview(self._received) as view:
                text, data = bytes(view[HEAD.size : HEAD.size + said]), bytes(view[HEAD.size + said : whole])
            del self._received[:whole]
            try:
                told, *content = json.loads(text)
                if told == "ended":
                    self._fault = None if content[0] is None else _fault(*content[0])
                    return True
                if told == "exits":
                    self._exited, self._exits = True, content[0]
                    continue
                if told == "ready":
                    self._wait()
                    continue
                if told == "log":
                    self._count(said)
                if told != "advance":
                    self._stage.tell(told, *content, data=data)
                    continue
                wanted, target, until = content
                asked = frozenset(wanted), None if target is None else float(target), float(until)
            except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
                raise _StoppedError(f"it sent what is no message of a node: {error}") from error
            if self._stage.over:
                raise _StoppedError("it asked for a step after the end of the run")
            self._advance(*asked)
        return False

    def _advance(self, wanted: Collection[str], target: float | None, until: float) -> None:
        now, news = self._stage.advance(wanted, target, until)
        sizes, parts = [], []
        for topic, data, pixels in news:
            sizes.append((topic, len(data), 0 if pixels is None else len(pixels)))
            parts += [data] if pixels is None else [data, pixels]
        with suppress(BrokenPipeError, ConnectionResetError):  # the node is gone: its link will say so
            for part in (packed([now, sizes]), *parts):
                self._ends[-1].sendall(part)
        self._wait()

    def _wait(self) -> None:
        """Give the node its time until the next step."""
        self._wait_until = time.monotonic() + self._limits.patience + GRACE_S


def _fault(how: str, message: str, traceback: str, line: int | None) -> Fault:
    return Fault(str(how), str(message), str(traceback), line if isinstance(line, int) else None)
