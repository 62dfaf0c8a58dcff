"""Which tests run which lines: a changed statement is noticed by those that run it, or by none."""

from __future__ import annotations

import ast
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, TypeAlias

import pytest

ROOT = Path(__file__).parents[2]
#: What pytest is told in every fork.
OPTIONS = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=", "-m", "not slow", "--no-header"]
OPTIONS += ["-W", "ignore:Module already imported"]

Ran: TypeAlias = dict[str, tuple[float, list[str]]]
"""By test: how long it takes [s], and the lines that it runs, each as path:line."""


def spans(tree: ast.AST, within: bool = False) -> Iterator[tuple[int, int, bool]]:
    """First and last line of every statement, without its body, and whether a test runs it whenever it counts.

    What runs at import, or once for all tests since its answer is cached, counts in tests that do not run it.
    """
    for child in ast.iter_child_nodes(tree):
        inside = within
        if isinstance(child, ast.FunctionDef):
            inside = not any("cache" in ast.dump(one) for one in child.decorator_list)
        if isinstance(child, ast.stmt):
            body = getattr(child, "body", None)
            last = body[0].lineno - 1 if isinstance(body, list) else child.end_lineno or child.lineno
            defines = isinstance(child, (ast.FunctionDef, ast.ClassDef))
            yield child.lineno, max(last, child.lineno), within and not defines
        yield from spans(child, inside)


class Lines:
    """A pytest plugin that notes how long each test takes [s], and which lines of files it runs."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.files = {str(path): str(path.relative_to(ROOT)) for path in files}
        self.ran: Ran = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Trace one test."""
        began, lines = time.monotonic(), set()

        def local(frame: FrameType, _event: str, _arg: object) -> Any:
            lines.add(f"{self.files[frame.f_code.co_filename]}:{frame.f_lineno}")
            return local

        sys.settrace(lambda frame, *_: local if frame.f_code.co_filename in self.files else None)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            self.ran[item.nodeid] = time.monotonic() - began, sorted(lines)


def traced(tests: Sequence[str], files: Sequence[Path]) -> Ran:
    """Return how long each test takes [s], and which lines of the files it runs."""
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder, "ran.json")
        child = os.fork()
        if child == 0:
            try:
                silence()
                plugin = Lines(files)
                pytest.main([*OPTIONS, *tests], plugins=[plugin])
                told.write_text(json.dumps(plugin.ran))
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        ran: Ran = json.loads(told.read_text())
        return ran


def choice(path: str, line: int, ran: Ran) -> tuple[list[str], float]:
    """Return the tests that can notice a change in a line of a file, the quickest first, and how long they take [s]."""
    around = [one for one in spans(ast.parse((ROOT / path).read_text())) if one[0] <= line <= one[1]]
    first, last, whenever = min(around, key=lambda one: one[1] - one[0], default=(0, 0, False))
    lines = {f"{path}:{number}" for number in range(first, last + 1)}
    tests = sorted((took, test) for test, (took, its) in ran.items() if not whenever or lines & set(its))
    return [test for _, test in tests], sum(took for took, _ in tests)


def silence() -> None:
    """Begin a session of its own for a fork, which tells nothing."""
    os.setsid()
    quiet = os.open(os.devnull, os.O_RDWR)
    for fd in (0, 1, 2):
        os.dup2(quiet, fd)
