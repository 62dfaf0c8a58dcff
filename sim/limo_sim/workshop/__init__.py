"""The workshop: template nodes, model solutions, and a checker that runs a student's file."""

from __future__ import annotations

from pathlib import Path

_START, _END = "# >>> ", "# <<<"
_BLANKS = {"1": "picture = image.copy()", "2": "boxes, weights = [], []", "3": "cx = None"}


def solution(node: str) -> str:
    """Return a model solution's text."""
    return "".join(line for line in _text(node) if not line.lstrip().startswith((_START, _END)))


def template(node: str) -> str:
    """Return the text a student begins with: the solution without what is between its marks."""
    kept: list[str] = []
    inside = False
    for line in _text(node):
        indent, mark = line[: len(line) - len(line.lstrip())], line.strip()
        if mark.startswith(_START):
            inside = True
            task = mark.removeprefix(_START)
            kept.append(f"{indent}# Your code of task {task}, in place of what stands here:\n")
            kept.append(f"{indent}{_BLANKS.get(task, 'self.commands.publish(Twist())')}\n")
        elif mark == _END:
            inside = False
        elif not inside:
            kept.append(line)
    return "".join(kept)


def _text(node: str) -> list[str]:
    path = Path(__file__).with_name("nodes") / f"{node}.solution.txt"
    return path.read_text(encoding="utf-8").splitlines(keepends=True)
