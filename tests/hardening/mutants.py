"""A seeded sample of mutants: one operator, number, condition or statement changed at a time, which a test must notice.

`python -m tests.hardening.mutants safety score --count 200 --state FILE` prints those that no test notices. Each mutant
runs in a fork of this process that imports the changed module from memory, and tries the tests that run the changed
statement, the quickest first; no file is touched. FILE keeps what was decided, and a later run goes on.
"""

from __future__ import annotations

import argparse
import ast
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import pytest
from tests.hardening.traced import OPTIONS, choice, silence, traced

ROOT = Path(__file__).parents[2]
FOLLOW, ROS2, SIM = "python/limo_hog/follow", "python/limo_hog/ros2", "sim/limo_sim"

#: What is changed, and the tests that must notice.
ROOMS: dict[str, tuple[list[str], list[str]]] = {
    "safety": (
        [f"{FOLLOW}/safety.py", f"{FOLLOW}/sense/clearance.py"],
        ["tests/follow/safety", "tests/follow/sense/test_clearance.py", "tests/follow/test_pipeline.py"],
    ),
    "score": (
        [f"{SIM}/run/score/*.py", f"{SIM}/run/matching.py"],
        [
            f"tests/sim/run/test_{name}.py"
            for name in ("matching", "score", "score_bounds", "score_losses", "score_sweep")
        ],
    ),
    "control": (
        [f"{FOLLOW}/control/*.py", f"{FOLLOW}/robot.py"],
        [
            *("tests/follow/control", "tests/follow/sense/test_clearance.py", "tests/follow/tracks"),
            "tests/follow/test_pipeline.py",
        ],
    ),
    "tracks": (
        [f"{FOLLOW}/tracks/*.py"],
        [
            "tests/follow/tracks",
            *(f"tests/follow/control/test_{name}.py" for name in ("tracking", "tracking_identity")),
        ],
    ),
    "sense": (
        [f"{FOLLOW}/sense/{name}.py" for name in ("detectors", "measurement", "observation")],
        [
            *(f"tests/follow/sense/test_{name}.py" for name in ("appearance", "detectors", "region", "ranging")),
            "tests/follow/tracks",
            *(
                f"tests/follow/control/test_{name}.py"
                for name in ("workshop_controllers", "tracking", "tracking_identity")
            ),
            "tests/follow/test_pipeline.py",
        ],
    ),
    "arena": (
        [f"{SIM}/run/arena.py"],
        [
            *("tests/sim/world/test_robot.py", "tests/sim/run/test_arena.py", "tests/sim/sensing/test_lidar.py"),
            *("tests/sim/world/test_movers.py", "tests/sim/run/test_unchanged.py"),
            # They take most of the time, and tell of other things.
            *(
                f"--deselect=tests/sim/run/test_arena.py::test_{name}"
                for name in ("memory_stays_flat", "nothing_goes_through_a_wall")
            ),
        ],
    ),
    "run": (
        [f"{SIM}/run/{name}.py" for name in ("episode", "detector_faults", "sweep")],
        [
            f"tests/sim/run/test_{name}.py"
            for name in ("summary", "detector_faults", "episode", "score_sweep", "everywhere")
        ],
    ),
    "env": ([f"{SIM}/env.py"], ["tests/sim/test_env.py"]),
    "messages": ([f"{ROS2}/messages.py"], ["tests/ros2/test_messages.py"]),
}
#: Libraries that are imported before the forks; ours are imported in each.
LIBRARIES = (
    *("cv2", "gymnasium", "hypothesis", "numpy", "numpy.testing", "PIL.Image", "pymunk", "pytest", "rosbags.serde"),
    *("rosbags.typesys", "scipy.stats", "skimage", "mcap.writer", "mcap.reader", "rich.progress", "_pytest.runner"),
)
#: A mutant that takes so much longer than none hangs [times, s].
LATEST = 4.0, 30.0

COMPARED: dict[type[ast.cmpop], list[type[ast.cmpop]]] = {
    ast.Lt: [ast.LtE, ast.GtE],
    ast.LtE: [ast.Lt, ast.Gt],
    ast.Gt: [ast.GtE, ast.LtE],
    ast.GtE: [ast.Gt, ast.Lt],
    ast.Eq: [ast.NotEq],
    ast.NotEq: [ast.Eq],
    ast.Is: [ast.IsNot],
    ast.IsNot: [ast.Is],
    ast.In: [ast.NotIn],
    ast.NotIn: [ast.In],
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
CALLED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
CALLED |= {"floor": "ceil", "ceil": "floor", "sin": "cos", "cos": "sin", "argmin": "argmax", "argmax": "argmin"}


@dataclass(frozen=True)
class Mutant:
    """A change of one file: the number of the change in the order of `changes`, its line, and what it does."""

    path: str
    number: int
    line: int
    told: str

    @property
    def key(self) -> str:
        """Its name in the state file."""
        return f"{self.path}:{self.line}: {self.told} #{self.number}"


def changes(tree: ast.Module) -> Iterator[tuple[ast.AST, str, Any]]:
    """Every change of a module: the node, what is told of it, and a function that makes it."""
    for node in walked(tree):
        if isinstance(node, ast.Compare):
            for at, operator in enumerate(node.ops):
                for other in COMPARED[type(operator)]:
                    yield (
                        node,
                        f"{name(operator)} becomes {name(other)}",
                        lambda n=node, i=at, o=other: n.ops.__setitem__(i, o()),
                    )
        elif isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in COMPUTED:
            becomes = COMPUTED[type(node.op)]
            yield node, f"{name(node.op)} becomes {name(becomes)}", lambda n=node, o=becomes: setattr(n, "op", o())
        elif isinstance(node, ast.BoolOp):
            joined: Any = ast.Or if isinstance(node.op, ast.And) else ast.And
            yield node, f"{name(node.op)} becomes {name(joined)}", lambda n=node, o=joined: setattr(n, "op", o())
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            yield node, f"{node.value} is inverted", lambda n=node: setattr(n, "value", not n.value)
        elif isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
            for value in {node.value + 1, node.value * 2 if node.value else -1}:
                yield node, f"{node.value!r} becomes {value!r}", lambda n=node, v=value: setattr(n, "value", v)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub, ast.Invert)):
            # Twice is not at all.
            same = {ast.Not: ast.Not, ast.USub: ast.USub, ast.Invert: ast.Invert}[type(node.op)]
            yield (
                node,
                f"{name(node.op)} is lost",
                lambda n=node, o=same: setattr(n, "operand", ast.UnaryOp(o(), n.operand)),
            )
        elif isinstance(node, (ast.If, ast.While, ast.IfExp)) or (isinstance(node, ast.comprehension) and node.ifs):

            def inverted(n: Any = node) -> None:
                if isinstance(n, ast.comprehension):
                    n.ifs[0] = ast.UnaryOp(ast.Not(), n.ifs[0])
                else:
                    n.test = ast.UnaryOp(ast.Not(), n.test)

            yield node, "the condition is inverted", inverted
        elif isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in CALLED:
                field = "attr" if isinstance(node.func, ast.Attribute) else "id"
                yield (
                    node,
                    f"{called} becomes {CALLED[called]}",
                    lambda n=node, f=field, c=called: setattr(n.func, f, CALLED[c]),
                )
        for body in (getattr(node, "body", None), getattr(node, "orelse", None)):
            for at, statement in enumerate(body if isinstance(body, list) else ()):
                if lost(statement):
                    yield statement, "the statement is lost", lambda b=body, i=at: b.__setitem__(i, ast.Pass())


def lost(statement: ast.stmt) -> bool:
    """Whether a statement is one that may be left out: a call, a change, a jump, a command."""
    if isinstance(statement, ast.Expr):
        return isinstance(statement.value, ast.Call)
    return isinstance(statement, (ast.AugAssign, ast.Continue, ast.Break, ast.Raise)) or (
        isinstance(statement, ast.Assign) and isinstance(statement.targets[0], (ast.Attribute, ast.Subscript))
    )


def walked(tree: ast.AST) -> Iterator[ast.AST]:
    """Every node in order, without annotations, imports, messages of errors, decorators and docstrings.

    The bounds that a parameter has on the live page are left out too: they decide nothing in a run.
    """
    yield tree
    if isinstance(tree, ast.Call) and getattr(tree.func, "id", "") == "bounded":
        yield from walked(tree.args[0])
        return
    for field, value in ast.iter_fields(tree):
        if field in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        if isinstance(tree, (ast.Raise, ast.JoinedStr)):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, (ast.Import, ast.ImportFrom)):
                yield from walked(child)


def name(operator: Any) -> str:
    """Return the name of an operator's class."""
    return (operator if isinstance(operator, type) else type(operator)).__name__


def mutants_of(path: Path) -> list[Mutant]:
    """Every mutant of a file."""
    tree = ast.parse(path.read_text())
    where = str(path.relative_to(ROOT))
    return [
        Mutant(where, number, getattr(node, "lineno", getattr(getattr(node, "target", None), "lineno", 0)), told)
        for number, (node, told, _) in enumerate(changes(tree))
    ]


def compiled(mutant: Mutant) -> CodeType:
    """Return the changed module's code."""
    path = ROOT / mutant.path
    tree = ast.parse(path.read_text())
    for number, (_, _, change) in enumerate(changes(tree)):
        if number == mutant.number:
            change()
            break
    return compile(ast.fix_missing_locations(tree), str(path), "exec")


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports a mutant in the place of its module."""

    def __init__(self, mutant: Mutant) -> None:
        parts = Path(mutant.path).with_suffix("").parts[1:]
        self.module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        self.path, self.code = str(ROOT / mutant.path), compiled(mutant)

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 - the protocol's
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self.module:
            return None
        return importlib.util.spec_from_file_location(fullname, self.path, loader=self)

    def exec_module(self, module: ModuleType) -> None:
        exec(self.code, module.__dict__)


def tried(tests: Sequence[str], mutant: Mutant | None, seconds: float) -> tuple[bool, float]:
    """Run the tests in a fork; return whether one fails, or they do not end, and how long that took [s]."""
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        code = 3
        try:
            silence()
            if mutant is not None:
                sys.meta_path.insert(0, Changed(mutant))
            code = int(pytest.main(["-x", *OPTIONS, *tests]))
        finally:
            os._exit(code)
    while (done := os.waitpid(child, os.WNOHANG)) == (0, 0):
        if time.monotonic() - began > seconds:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return True, time.monotonic() - began
        time.sleep(0.02)
    return done[1] != 0, time.monotonic() - began


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rooms", nargs="*", choices=[*ROOMS, []], help="default: all")
    parser.add_argument("--count", type=int, default=40, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", type=Path, help="where it is kept which were noticed")
    parser.add_argument("--again", action="store_true", help="try those once more that no test noticed")
    args = parser.parse_args()
    os.chdir(ROOT)
    for library in LIBRARIES:
        importlib.import_module(library)
    state: dict[str, dict[str, bool]] = {}
    if args.state and args.state.exists():
        state = json.loads(args.state.read_text())
    for room in args.rooms or ROOMS:
        patterns, tests = ROOMS[room]
        files = sorted({path for pattern in patterns for path in ROOT.glob(pattern)})
        every = [mutant for path in files for mutant in mutants_of(path)]
        sample = random.Random(args.seed).sample(every, min(args.count, len(every)))
        decided = state.setdefault(room, {})
        if tried(tests, None, 600.0)[0]:
            print(f"{room}: the tests fail without a mutant")
            return 2
        ran = traced(tests, files)
        for mutant in sample:
            if mutant.key not in decided or (args.again and not decided[mutant.key]):
                chosen, took = choice(mutant.path, mutant.line, ran)
                decided[mutant.key] = bool(chosen) and tried(chosen, mutant, LATEST[0] * took + LATEST[1])[0]
                if args.state:
                    args.state.write_text(json.dumps(state, indent=1))
        noticed = sum(decided[mutant.key] for mutant in sample)
        print(f"{room}: {noticed} of {len(sample)} noticed ({noticed / len(sample):.1%}) of {len(every)} there are")
        for mutant in sorted(sample, key=lambda mutant: (mutant.path, mutant.line)):
            if not decided[mutant.key]:
                print(f"  {mutant.key}")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
