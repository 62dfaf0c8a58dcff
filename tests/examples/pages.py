"""The Markdown pages of the repository, and what is in them."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(!?)\[[^\]]*\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Page:
    path: Path

    def __str__(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @property
    def python(self) -> list[str]:
        return [body for language, body in _FENCE.findall(self.text) if language == "python"]

    @property
    def links(self) -> list[str]:
        return [target for _, target in _LINK.findall(_FENCE.sub("", self.text))]

    @property
    def anchors(self) -> set[str]:
        """What `#…` may lead to: each heading in small letters, hyphens for spaces, without punctuation."""
        headings = re.findall(r"^#+ (.*)$", _FENCE.sub("", self.text), re.MULTILINE)
        return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def file_of(page: Page, link: str) -> Path | None:
    """The file in the repository that a link leads to; None for other places on the web."""
    target = link.partition("#")[0]
    if "://" in target or target.startswith("mailto:"):
        return None
    return (page.path.parent / target).resolve() if target else page.path
