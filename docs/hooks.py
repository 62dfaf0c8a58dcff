"""The site's pages from the repository's Markdown: whole files where a page names one, links that fit both places."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).parents[1]
_SOURCES = "https://github.com/limo-hog/limo-hog/blob/main/"
#: README.md is shown on package pages too, so that its links are whole addresses.
_PAGES = re.compile(r"https://(?:github|raw\.githubusercontent)\.com/limo-hog/limo-hog/(?:blob/)?main/docs/")
_OUTSIDE = re.compile(r"\]\((?:\.\./)+((?:examples|benches|README|ARCHITECTURE|CONTRIBUTING)[^)]*)\)")
_FILE = re.compile(r"^\{(\w+\.md)\}$", re.MULTILINE)


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Put files in place of lines such as {README.md}; point links at pages, or else at the repository."""
    whole = _FILE.sub(lambda name: (_ROOT / name[1]).read_text("utf-8"), markdown)
    if whole != markdown:
        whole = re.sub(r"\]\((?:docs/)([^)]*)\)", r"](\1)", whole)
    up = posixpath.relpath(".", posixpath.dirname(page.file.src_uri) or ".")
    return _OUTSIDE.sub(rf"]({_SOURCES}\1)", _PAGES.sub("" if up == "." else f"{up}/", whole))
