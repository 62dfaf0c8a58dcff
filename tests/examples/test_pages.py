"""README and docs: links lead somewhere, every page can be reached, Python blocks are Python and import what exists."""

from __future__ import annotations

import ast
import importlib

import pytest
from tests.examples.pages import REPOSITORY, ROOT, Page, file_of, pages

PAGES = pages()
#: Shown on package pages as well as in the repository.
ON_PACKAGE_PAGES = [page for page in PAGES if page.path.name == "README.md" and "docs" not in page.path.parts]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_link_leads_to_a_file_and_a_heading(page: Page) -> None:
    dead = []
    for link in page.links:
        file, anchor = file_of(page, link), link.partition("#")[2]
        if file is None:
            continue
        if not file.exists() or (anchor and anchor not in Page(file).anchors):
            dead.append(link)
    assert dead == []


def is_of_the_site(page: Page) -> bool:
    """Whether only the site shows a page: `.ci/docs` holds that its menu has them all."""
    return page.path.parent == ROOT / "docs" / "reference" or str(page) in ("docs/index.md", "docs/changelog.md")


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        path = waiting.pop()
        if path not in reached and path.suffix == ".md":
            reached.add(path)
            waiting += [file for link in Page(path).links if (file := file_of(Page(path), link)) and file.is_file()]
    assert [str(page) for page in PAGES if page.path not in reached and not is_of_the_site(page)] == []


def test_two_readmes_are_shown_on_package_pages() -> None:
    assert [str(page) for page in ON_PACKAGE_PAGES] == ["README.md", "sim/README.md"]


@pytest.mark.parametrize("page", ON_PACKAGE_PAGES, ids=str)
def test_a_package_page_has_no_relative_link(page: Page) -> None:
    relative = [link for link in page.links if not link.startswith(("https://", "#"))]
    assert relative == [], f"write {REPOSITORY}… for files of the repository"


BLOCKS = [(page, i, block) for page in PAGES for i, block in enumerate(page.python)]


def test_there_are_python_blocks_to_look_at() -> None:
    assert len(BLOCKS) > 8


@pytest.mark.parametrize(
    ("page", "i", "block"), BLOCKS, ids=lambda value: str(value) if isinstance(value, Page) else ""
)
def test_python_blocks_compile_and_import_what_exists(page: Page, i: int, block: str) -> None:
    tree = ast.parse(block, filename=f"{page} block {i}")
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for name in node.names:
                importlib.import_module(name.name)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(str(node.module))
            assert [name.name for name in node.names if not hasattr(module, name.name)] == []
    # What is reached by its full name, as in `limo_hog.visualize(...)`.
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "limo_hog":
            assert hasattr(importlib.import_module("limo_hog"), node.attr), node.attr
