"""Runs a script against the arena behind a link, and says what became of it; the process is the script's alone."""

from __future__ import annotations

import runpy
import sys
import tokenize
import traceback
from collections.abc import Sequence
from pathlib import Path

from limo_sim.ros.front import put_in_front
from limo_sim.ros.lockstep.patience import HungError
from limo_sim.ros.lockstep.records import Fault, StubError
from limo_sim.ros.lockstep.threads import take_turns
from limo_sim.ros.lockstep.turns import ExternalShutdownException, RunOver
from limo_sim.ros.lockstep.windows import watch_cv2
from limo_sim.ros.lockstep.world import World

_HERE = Path(__file__).parent


def run_script(world: World, arguments: Sequence[str]) -> Fault | None:
    """Run the world's script as `python SCRIPT ARGUMENTS` would; return why it ended before its time, None if not."""
    sys.argv = [str(world.script), *arguments]
    here = world.script.resolve().parent
    # As where it is installed, an ament package finds its own modules: beside package.xml, or in the folder above.
    packages = [folder for folder in (here, *here.parents[:3]) if (folder / "package.xml").is_file()]
    sys.path[:0] = [str(folder) for folder in (here, *packages, *(folder.parent for folder in packages))]
    put_in_front(world)
    take_turns(world.turns)
    watch_cv2(world)
    try:
        with world.patience.watching(), world.turns.main():
            _check_encoding(world.script)
            runpy.run_path(str(world.script), run_name="__main__")
    except (RunOver, ExternalShutdownException):
        pass
    except SystemExit as exit_:
        if exit_.code not in (None, 0):
            world.fault = world.fault or StubError(f"sys.exit({exit_.code!r})")
    except BaseException as error:
        world.fault = world.fault or error
    return None if world.fault is None else _told(world.fault, str(world.script))


def _check_encoding(script: Path) -> None:
    """Refuse a source that `python SCRIPT` refuses, and `compile` does not where the odd byte is in a comment."""
    try:
        with tokenize.open(script) as source:
            source.read()
    except UnicodeDecodeError as error:
        said = f"byte {error.object[error.start]:#x} is no {error.encoding}: save the file as UTF-8"
        raise SyntaxError(said, (str(script), None, None, None)) from None


def _told(error: BaseException, script: str) -> Fault:
    how = "hung" if isinstance(error, HungError) else f"failed with {type(error).__name__}"
    try:
        message = str(error)
    except BaseException as second:  # whatever a class of the script's raises
        message = f"its text cannot be read: __str__ raises {type(second).__name__}"
    if isinstance(error, EOFError) or type(error).__module__ == "termios":
        message += "; a node has no keyboard here: give it parameters, --ros-args -p NAME:=VALUE"
    lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_code.co_filename == script]
    if not lines and isinstance(error, SyntaxError) and error.filename == script and error.lineno:
        lines = [error.lineno]
    return Fault(how, message, _script_traceback(error), lines[-1] if lines else None)


def _script_traceback(error: BaseException) -> str:
    """Return the traceback without the frames of limo-hog and of what runs the script; "" without one."""
    if error.__traceback__ is None:
        return ""
    told = traceback.TracebackException.from_exception(error)
    link: traceback.TracebackException | None = told
    while link is not None:
        theirs = (frame for frame in link.stack if not frame.filename.startswith(("<frozen", str(_HERE))))
        frames = [frame for frame in theirs if Path(frame.filename).name != "runpy.py"]
        link.stack = traceback.StackSummary.from_list(frames)
        link = link.__cause__ or link.__context__
    return "".join(told.format())
