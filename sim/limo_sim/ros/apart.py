"""Runs a node in a process of its own: one that exits, crashes or never returns still leaves a log that can be scored.

The arena runs in the node's process. It sends every control period here, and waits until that was watched. Where the
process dies, the arena is run again with the node's commands up to then, and on until the robot stands: the same
scenario, seed and commands give the same run.
"""

from __future__ import annotations

import faulthandler
import io
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from limo_hog.exceptions import LimoHogError
from limo_sim.ros.lockstep.patience import DiedError, HungError
from limo_sim.ros.lockstep.records import Log, Past, StubError
from limo_sim.ros.lockstep.world import World
from limo_sim.ros.script import Ended, finished, run_script
from limo_sim.run.log import Step, Watch
from limo_sim.run.score import Scorer
from limo_sim.world.scenario import Scenario
from limo_sim.world.variants import of_run

#: A node that hangs is interrupted in its own process; where it takes no interrupt, the process is stopped so much
#: later [s]. Chosen: a busy computer may be late by a second or two.
GRACE_S = 5.0
#: How long the process may take to start [s]: it imports numpy, OpenCV and rosbags. Chosen for a slow disk.
_START_S = 120.0
#: How long the process may take to end by itself, after its last message or after Ctrl-C [s].
_END_S = 1.0
#: How often it is looked whether the process still lives, while it says nothing [s].
_LOOK_S = 0.2


@dataclass(frozen=True)
class _Job:
    """What the process is to run.

    Attributes
    ----------
    pictures
        Whether what the node sees is to be sent.
    clock
        Memory that both processes share, with the arena's time [s].
    """

    script: Path
    scenario: Scenario
    seconds: float
    seed: int
    arguments: Sequence[str]
    patience: float
    pictures: bool
    clock: Any


def run_apart(
    script: Path,
    scenario: Scenario,
    seconds: float,
    seed: int = 0,
    *,
    arguments: Sequence[str] = (),
    log: Log = lambda *_: None,
    watch: Watch = lambda _: None,
    pictures: bool = True,
    patience: float = 20.0,
) -> Ended:
    """Run a script as `run_script` does, in a process of its own; its arguments mean the same.

    What the script prints is printed here. Its standard input is empty.

    Parameters
    ----------
    pictures
        Whether `watch` is given the frames, scans and windows; without, it is given bare steps.

    Raises
    ------
    StubError
        If there is no such script.
    """
    if not script.is_file():
        raise StubError(f"{script}: no such file")
    began = time.perf_counter()
    spawning = multiprocessing.get_context("spawn")
    ours, theirs = spawning.Pipe()
    # (A process that dies has told its time.)
    clock = spawning.Value("d", 0.0, lock=False)
    job = _Job(script, scenario, seconds, seed, list(arguments), patience, pictures, clock)
    child = spawning.Process(target=_run, args=(theirs, job), name=script.name, daemon=True)
    past = Past(Scorer(of_run(scenario, seed)))
    child.start()
    theirs.close()
    try:
        ended = _listen(ours, child, past, job, log, watch)
    finally:
        ours.close()
        child.join(_END_S)
        silent = child.is_alive()
        if silent:
            child.kill()
            child.join()
    if ended is not None:
        return replace(ended, episode=replace(ended.episode, scorer=past.scorer))
    world = World(scenario, seed, seconds, script=script, log=log, watch=watch, patience=patience, began=began)
    world.take_over(past, clock.value)
    world.fault = _why(child, silent, patience)
    return finished(world)


def _why(child: BaseProcess, silent: bool, patience: float) -> DiedError | HungError:
    """Say what became of a process that did not report the run's end."""
    if silent:
        return HungError(
            f"no simulated time has passed for {patience:g} s, and it took no interrupt: its process was stopped"
        )
    code = child.exitcode or 0
    if code >= 0:
        return DiedError(f"its process ended with status {code} before the run was over, as by os._exit")
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return DiedError(f"its process was ended by {name}")


def _listen(
    connection: Connection,
    child: BaseProcess,
    past: Past,
    job: _Job,
    log: Log,
    watch: Watch,
) -> Ended | None:
    """Take what the process tells until the run is over; None where it dies or falls silent before."""
    limit = _START_S
    while True:
        since, at = time.monotonic(), job.clock.value
        while not connection.poll(_LOOK_S):
            if at != job.clock.value:
                since, at = time.monotonic(), job.clock.value
            # (A process that the node has forked may hold the connection open.)
            if time.monotonic() - since > limit or not (child.is_alive() or connection.poll(0)):
                return None
        limit = job.patience + GRACE_S
        try:
            told, content = connection.recv()
        except (EOFError, OSError):
            return None
        if told == "step":
            step, asked, target = content
            past.add(step)
            past.detector_inputs, past.target_distance = asked, target
            watch(step)
            connection.send_bytes(b"go on")
        elif told == "commands":
            for command in content:
                past.commands.extend((command.time, command.twist.linear, command.twist.angular))
        elif told == "log":
            log(*content)
        elif told == "print":
            name, text = content
            (sys.stdout if name == "stdout" else sys.stderr).write(text)
        elif told == "end":
            ended: Ended = content
            return ended
        elif told == "error":
            raise content


class _Link:
    """The process's end of the connection. A thread sends, so that no signal interrupts it in the middle."""

    def __init__(self, connection: Connection, job: _Job) -> None:
        self._connection = connection
        self._pictures, self._clock = job.pictures, job.clock
        self._waiting: SimpleQueue[tuple[str, Any, threading.Event]] = SimpleQueue()
        self._world: World | None = None
        self._commands = 0
        threading.Thread(target=self._send, name="limo-hog run", daemon=True).start()

    def _send(self) -> None:
        while True:
            told, content, sent = self._waiting.get()
            with suppress(OSError):  # the other process is gone
                self._connection.send((told, content))
            sent.set()

    def tell(self, told: str, content: Any = None) -> None:
        """Send a message; return when it has left, and so is not lost where the process dies."""
        sent = threading.Event()
        self._waiting.put((told, content, sent))
        sent.wait()

    def made(self, world: World) -> None:
        """Take the world of the run."""
        self._world = world
        world.patience.passing = self.passing

    def passing(self) -> None:
        """Tell the arena's time and the commands that are new."""
        world = self._world
        if world is None:
            return
        self._clock.value = world.time
        if len(world.commands) > self._commands:
            self.tell("commands", world.commands[self._commands :])
            # The newest is in force; the others are needed in the other process alone.
            del world.commands[:-1]
            self._commands = 1

    def log(self, *line: Any) -> None:
        """Pass on what the node logs."""
        self.tell("log", line)

    def watch(self, step: Step) -> None:
        """Pass on a control period, and wait until it was watched."""
        world = self._world
        if world is None:
            return
        told = step if self._pictures else step.bare()
        self.tell("step", (told, list(world.detector_inputs), world.target_distance))
        self._connection.recv_bytes()


class _Printed(io.TextIOBase):
    """Standard output or error of the node: passed on, so that both keep their order with the log."""

    def __init__(self, link: _Link, name: str, fd: int) -> None:
        self._link, self._name, self._fd = link, name, fd

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return "utf-8"

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._fd

    def write(self, text: str) -> int:
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")
        self._link.tell("print", (self._name, text))
        return len(text)


def _run(connection: Connection, job: _Job) -> None:
    """Be the process: run the script, and tell what happens."""
    # What is not printed by Python, such as a library's own messages, must not mix with JSON on standard output.
    os.dup2(2, 1)
    faulthandler.enable(2, all_threads=False)
    link = _Link(connection, job)
    sys.stdout, sys.stderr = _Printed(link, "stdout", 1), _Printed(link, "stderr", 2)
    try:
        outcome = run_script(
            job.script,
            job.scenario,
            job.seconds,
            job.seed,
            arguments=job.arguments,
            log=link.log,
            watch=link.watch,
            patience=job.patience,
            made=link.made,
        )
    except (KeyboardInterrupt, EOFError) as error:
        link.tell("error", KeyboardInterrupt(*error.args))
    except (LimoHogError, OSError, MemoryError) as error:
        link.tell("error", error)
    else:
        link.tell("end", Ended(outcome.episode, outcome.failure, outcome.traceback, outcome.used_hog))
