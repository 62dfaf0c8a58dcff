"""Runs a script against the arena; a script that fails ends with its traceback and a robot that stands."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from limo_hog.ros2 import names
from limo_sim.ros.front import in_front
from limo_sim.ros.lockstep.patience import DiedError, HungError
from limo_sim.ros.lockstep.records import Log, StubError
from limo_sim.ros.lockstep.turns import ExternalShutdownException, RunOver
from limo_sim.ros.lockstep.windows import watched_cv2
from limo_sim.ros.lockstep.world import World
from limo_sim.ros.rclpy_stub.context import Context
from limo_sim.run.episode import Episode, score
from limo_sim.run.log import Watch
from limo_sim.run.score import ScoreCard
from limo_sim.world.scenario import Scenario

#: Simulated time after a script's failure, in which the watchdog stops the robot [s]: 0.5 s and 1 m/s over 1 m/s².
_AFTERMATH = 2.0

_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Ended:
    """How a run ended.

    Attributes
    ----------
    episode
        The log that is scored.
    failure
        One line that names the fault; "" without one.
    traceback
        The script's part of the traceback; "" without an exception.
    used_hog
        Whether the script used cv2's HOG detector.
    """

    episode: Episode
    failure: str
    traceback: str
    used_hog: bool


@dataclass(frozen=True)
class Outcome(Ended):
    """How a run in this process ended; `world` is the run, with its log, commands and windows."""

    world: World


def run_script(
    script: Path,
    scenario: Scenario,
    seconds: float,
    seed: int = 0,
    *,
    arguments: Sequence[str] = (),
    log: Log = lambda *_: None,
    watch: Watch = lambda _: None,
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
        Called with every line that the script logs.
    watch
        Called with every control period.
    patience
        Wall time that the script may take without letting simulated time pass [s].
    made
        Called with the world before the script runs.

    Raises
    ------
    StubError
        If there is no such script.
    ScenarioError
        If the scenario asks for faults of the detector, which is the node's own here.
    """
    if not script.is_file():
        raise StubError(f"{script}: no such file")
    world = World(scenario, seed, seconds, script=script, log=log, watch=watch, patience=patience)
    if made is not None:
        made(world)
    argv, path = sys.argv, list(sys.path)
    sys.argv = [str(script), *arguments]
    sys.path.insert(0, str(script.resolve().parent))
    with in_front(world), watched_cv2(world):
        try:
            with world.patience.watching(), world.turns.main(Context(world)):
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
        # Ctrl-C in a callback ends the run, even if the script catches it.
        raise world.fault
    return finished(world)


def finished(world: World) -> Outcome:
    """Let the arena go on after the script's end, and return how the run ended."""
    failed_at = world.time
    if world.fault is not None:
        world.seconds = failed_at + _AFTERMATH
    # After the script's end the arena goes on without commands until the time is up.
    while not world.over:
        world.advance()
    failure = _failure(world, failed_at)
    shown = "" if world.fault is None else _script_traceback(world.fault)
    return Outcome(world.episode(), failure, shown, bool(world.detector_inputs), world)


def score_of(outcome: Ended) -> ScoreCard:
    """Measure a run; where the script does not use cv2's HOG detector, figures of detections are None.

    Whether such a script searches or follows is not known; `modes` then tells whether its commands drive or stand.
    """
    card, driving = score(outcome.episode), outcome.episode.scorer.driving
    if outcome.failure:
        card = replace(card, success=False, failure=outcome.failure)
    if outcome.used_hog:
        return card
    return replace(
        card,
        modes={"drive": driving, "stand": 1.0 - driving},
        first_detection_s=None,
        detected=None,
        best_box_wrong=None,
        longest_gap_s=None,
        lost=0,
        found_again=None,
        time_to_find_again_s=None,
        follows_first=None,
        identity_switches=None,
        detect_ms_p50=None,
        detect_ms_p95=None,
        detect_ms_mean=None,
    )


def _failure(world: World, failed_at: float) -> str:
    if world.fault is not None:
        kind = f"failed with {type(world.fault).__name__}"
        if isinstance(world.fault, (HungError, DiedError)):
            kind = "hung" if isinstance(world.fault, HungError) else "died"
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
    """Return the traceback without the frames of limo-hog and of what runs the script; "" without one."""
    if error.__traceback__ is None:
        return ""
    told = traceback.TracebackException.from_exception(error)
    link: traceback.TracebackException | None = told
    while link is not None:
        frames = [frame for frame in link.stack if not _ours(frame.filename)]
        link.stack = traceback.StackSummary.from_list(frames)
        link = link.__cause__ or link.__context__
    return "".join(told.format())


def _ours(filename: str) -> bool:
    return filename.startswith(("<frozen", str(_HERE))) or Path(filename).name == "runpy.py"
