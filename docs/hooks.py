"""The site's pages from the repository's Markdown: whole files where a page names one, links that fit both places."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).parents[1]
_SOURCES = "https://github.com/limo-hog/limo-hog/blob/main/"
_OUTSIDE = re.compile(r"\]\((?:\.\./)+((?:examples|benches|sim|README|ARCHITECTURE|CONTRIBUTING)[^)]*)\)")
_FILE = re.compile(r"^\{(\w+\.md)\}$", re.MULTILINE)
_LINK = re.compile(r"\]\((?!https://|#)([^)\s]+)\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put files in place of lines such as {README.md}; point links at pages, or else at the repository."""

    def from_the_root(link: re.Match[str]) -> str:
        inside = link[1].startswith("docs/")
        return f"]({posixpath.relpath(link[1], 'docs') if inside else _SOURCES + link[1]})"

    markdown = _FILE.sub(lambda name: _LINK.sub(from_the_root, (_ROOT / name[1]).read_text("utf-8")), markdown)
    return _OUTSIDE.sub(rf"]({_SOURCES}\1)", markdown)
