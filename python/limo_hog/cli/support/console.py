"""The console of tables, cards and progress bars: what it shows of others' text, a terminal does not obey."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from limo_hog.cli.support.output import printable


class SafeConsole(Console):
    """A rich console that escapes control characters; those of its own styles and bars are not text."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return the segments of what is printed."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment("\n".join(map(printable, segment.text.split("\n"))), segment.style)


def console(*, stderr: bool = False) -> Console:
    """Return a console on standard output, or on standard error."""
    return SafeConsole(stderr=stderr, highlight=False)
