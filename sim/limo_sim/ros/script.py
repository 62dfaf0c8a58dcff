"""Runs a script against the arena, and sees to it that a bad one ends in its traceback and a robot that stands."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from limo_hog.ros2 import names
from limo_sim.ros.lockstep.patience import HungError
from limo_sim.ros.lockstep.windows import watched_cv2
from limo_sim.ros.lockstep.world import Log, RunOver, StubError, World
from limo_sim.ros.rclpy_stub.executors import ExternalShutdownException
from limo_sim.ros.rclpy_stub.front import in_front
from limo_sim.run.episode import Episode, Moment
from limo_sim.run.score import ScoreCard, score
from limo_sim.world.scenario import Scenario

#: After the script failed, so much time is left for the watchdog to stop the robot [s].
_AFTERMATH = 2.0

_HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    world
        The run, with its log, commands and windows.
    episode
        What the score is made of.
    failure
        One line on what was wrong; "" where nothing was.
    traceback
        The script's part of the traceback; "" without an exception.
    """

    world: World
    episode: Episode
    failure: str
    traceback: str


def run_script(
    script: Path,
    scenario: Scenario,
    seconds: float,
    seed: int = 0,
    *,
    arguments: Sequence[str] = (),
    log: Log = lambda *_: None,
    watch: Callable[[Moment], None] | None = None,
    patience: float = 20.0,
    made: Callable[[World], None] | None = None,
) -> Outcome:
    """Run a script as `python SCRIPT ARGUMENTS` would, with the arena behind its topics.

    Parameters
    ----------
    script
        An ordinary rclpy script.
    scenario, seconds, seed
        The arena, and how much of its time the script gets [s].
    arguments
        Command line of the script; what follows --ros-args is ROS's.
    log
        Takes what the script's loggers say.
    watch
        Called with every control period.
    patience
        So long may the script take without letting simulated time pass [s of the wall's time].
    made
        Called with the world before the script runs.

    Raises
    ------
    StubError
        If there is no such script.
    """
    if not script.is_file():
        raise StubError(f"{script}: no such file")
    world = World(scenario, seed, seconds, script=script, log=log, watch=watch, patience=patience)
    if made is not None:
        made(world)
    argv, path = sys.argv, list(sys.path)
    sys.argv = [str(script), *arguments]
    sys.path.insert(0, str(script.resolve().parent))
    failed_at: float | None = None
    with in_front(world), watched_cv2(world):
        try:
            with world.patience.watching():
                runpy.run_path(str(script), run_name="__main__")
        except (RunOver, ExternalShutdownException):
            pass
        except SystemExit as exit_:
            if exit_.code not in (None, 0):
                world.fault = world.fault or StubError(f"sys.exit({exit_.code!r})")
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            world.fault = world.fault or error
        finally:
            sys.argv, sys.path[:] = argv, path
    if isinstance(world.fault, KeyboardInterrupt):
        # Ctrl-C in a callback is the user's, even if the script makes a good end of it.
        raise world.fault
    if world.fault is not None:
        failed_at = world.time
        world.seconds = failed_at + _AFTERMATH
    # A script that has ended sends nothing any more: the arena goes on without it.
    while not world.over:
        world.advance()
    failure = _failure(world, failed_at)
    shown = "" if world.fault is None else _script_traceback(world.fault)
    return Outcome(world, world.episode(), failure, shown)


def score_of(outcome: Outcome) -> ScoreCard:
    """Measure a run; what hangs on detections is None where the script's detector is not one that can be watched."""
    card = score(outcome.episode)
    if outcome.world.asked:
        return card
    return replace(
        card,
        first_detection_s=None,
        detected=None,
        best_box_wrong=None,
        longest_gap_s=None,
        lost=0,
        found_again=None,
        follows_first=None,
        identity_switches=None,
        detect_ms_p50=None,
        detect_ms_p95=None,
        detect_ms_mean=None,
    )


def _failure(world: World, failed_at: float | None) -> str:
    if world.fault is not None:
        kind = "hung" if isinstance(world.fault, HungError) else f"failed with {type(world.fault).__name__}"
        stopped = world.arena.odometry()
        stands = abs(stopped.linear) < 1e-6 and abs(stopped.angular) < 1e-6
        ending = "the watchdog stopped the robot" if stands else "the robot still moves"
        if not world.commands:
            ending = "the robot never moved"
        message = " ".join(str(world.fault).split())
        return f"{world.script.name} {kind} at {failed_at:.2f} s: {message}; {ending}"
    if not world.commands:
        other = ", ".join(sorted(world.published)) or "nothing at all"
        return f"{world.script.name} never published on {names.COMMAND} (it published {other}): the robot never moved"
    return ""


def _script_traceback(error: BaseException) -> str:
    """Return the traceback without the frames of limo-hog and of what runs the script."""
    told = traceback.TracebackException.from_exception(error)
    link: traceback.TracebackException | None = told
    while link is not None:
        frames = [frame for frame in link.stack if not _ours(frame.filename)]
        link.stack = traceback.StackSummary.from_list(frames)
        link = link.__cause__ or link.__context__
    return "".join(told.format())


def _ours(filename: str) -> bool:
    return filename.startswith(("<frozen", str(_HERE))) or Path(filename).name == "runpy.py"
