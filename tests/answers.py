"""How a command ended, and what it printed."""

from collections.abc import Callable
from typing import NamedTuple


class Answer(NamedTuple):
    code: int
    out: str
    err: str


#: A command line, word by word.
AnswerTo = Callable[..., Answer]
