"""README and docs: links lead somewhere, every page can be reached, Python blocks are Python and import what exists."""

import ast
import importlib
import re
import shutil
import subprocess
import sys
import zipfile
from collections import defaultdict
from pathlib import Path

import pytest
from benches.rivals import FOUND, finders
from tests.examples.pages import ROOT, Page, file_of

#: Every page that is written for readers of the repository.
PAGES = [*map(Page, sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "sim" / "README.md"]))]
#: Shown on package pages as well as in the repository.
READMES = [Page(ROOT / "README.md"), Page(ROOT / "sim" / "README.md")]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_link_leads_to_a_file_and_a_heading(page: Page) -> None:
    dead = []
    for link in page.links:
        file, anchor = file_of(page, link), link.partition("#")[2]
        if file and (not file.exists() or (anchor and anchor not in Page(file).anchors)):
            dead.append(link)
    assert dead == []
    # For the repository's own files a page needs no network.
    assert [link for link in page.links if "limo-hog/limo-hog/blob/main" in link or "githubusercontent" in link] == []


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


@pytest.fixture(scope="module")
def packaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what the pages link to, with the pages as the distributions are built from them."""
    folder = tmp_path_factory.mktemp("checkout")
    for page in READMES:
        for name in [page.path, *(file for link in page.links if (file := file_of(page, link)))]:
            copy = folder / name.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.mkdir(exist_ok=True) if name.is_dir() else shutil.copy(name, copy)
    (folder / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "package_page", folder / ".ci")
    subprocess.run([sys.executable, folder / ".ci" / "package_page"], check=True)
    return folder


@pytest.mark.parametrize("page", READMES, ids=str)
def test_a_package_page_has_the_readmes_links_as_whole_addresses(page: Page, packaged: Path) -> None:
    links = Page(packaged / page.path.relative_to(ROOT)).links
    assert [link for link in links if not link.startswith("https://")] == []
    home = re.compile(r"https://(?:github|raw\.githubusercontent)\.com/limo-hog/limo-hog/(?:(?:blob|tree)/)?main/(.*)")
    led = [ROOT / found[1].partition("#")[0] for link in links if (found := home.fullmatch(link))]
    assert led == [file for link in page.links if (file := file_of(page, link))]


@pytest.mark.parametrize(("text", "code"), [("[a](docs/a.md)", 1), ("[a](https://example.org/a.md)", 0)])
def test_a_distribution_with_a_relative_link_is_refused(text: str, code: int, tmp_path: Path) -> None:
    wheel = tmp_path / "a-1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("a-1.dist-info/METADATA", f"Name: a\n\n{text}\n")
    command = [sys.executable, str(ROOT / ".ci" / "package_page"), str(wheel)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == code


@pytest.mark.parametrize("page", [page for page in PAGES if not is_of_the_site(page)], ids=str)
def test_a_page_opens_with_a_sentence_that_says_what_it_is_for(page: Page) -> None:
    title, opening, *_ = page.text.split("\n\n")
    assert re.fullmatch(r"# .+", title)
    assert re.match(r"[*`]*\w", opening) and re.search(r"[.:][*]*$", opening)


#: What each file tells readers who missed it once, and words that they had to read twice.
READ = {
    "README.md": (
        ["git clone https://github.com/limo-hog/limo-hog", "or `CascadeClassifier`. [Coming from]"],
        ["keeps its words after", "without that in gray"],
    ),
    "docs/coming-from.md": (
        ["`cv2.ml` (SVM, KNearest, …) | gone", "`warpPerspective` | pixels differ", '# mypy: disable-error-code="attr'],
        [],
    ),
    "docs/parity.md": (["`computeGradient(image)` needs no arrays"], []),
    "docs/watching.md": (["takes at most 1.5 % longer with the page open"], ["as two cores can took"]),
    "python/limo_hog/cli/evaluate.py": (["lowest score counted"], ["no surer hit"]),
    "python/limo_hog/learn/evaluation/report.py": (["If the interval excludes 0"], ["An interval without 0"]),
}


@pytest.mark.parametrize("name", READ)
def test_what_readers_missed_is_told_and_what_they_read_twice_is_not(name: str) -> None:
    text = " ".join(Page(ROOT / name).text.split())
    told, untold = READ[name]
    assert [words for words in told if words not in text] == [words for words in untold if words in text] == []


def test_the_readme_shows_a_table_that_the_comparison_prints() -> None:
    table = [line for line in READMES[0].text.splitlines() if line.count("|") == 8]
    assert table[0] == f"| {' | '.join(FOUND)} |"
    assert [line.split(" | ")[0] for line in table[2:]] == [f"| {one.name}" for one in finders(64)]


def sentences(page: Page) -> set[str]:
    """The sentences of a page's prose, of six words or more, in small letters without punctuation."""
    prose = re.sub(r"^(```.*?^```|[|#].*?)$", "\n\n", page.text, flags=re.MULTILINE | re.DOTALL)
    parts = re.split(r"\n\s*\n|^- |^\d\. |(?<=[.:;!?])\s+", prose, flags=re.MULTILINE)
    return {re.sub(r"\W+", " ", part.lower()).strip() for part in parts if len(part.split()) >= 6}


def test_no_two_pages_have_a_sentence_in_common() -> None:
    homes = defaultdict(list)
    for page in PAGES:
        for sentence in sentences(page):
            homes[sentence].append(str(page))
    assert {sentence: where for sentence, where in homes.items() if len(where) > 1} == {}


BLOCKS = {f"{page} block {i}": block for page in PAGES for i, block in enumerate(page.python)}
assert len(BLOCKS) > 8


@pytest.mark.parametrize("name", BLOCKS)
def test_python_blocks_compile_and_import_what_exists(name: str) -> None:
    for node in ast.walk(ast.parse(BLOCKS[name], filename=name)):
        if isinstance(node, ast.Import):
            for imported in node.names:
                importlib.import_module(imported.name)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(str(node.module))
            assert [imported.name for imported in node.names if not hasattr(module, imported.name)] == []
        # What is reached by its full name, as in `limo_hog.visualize(...)`.
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "limo_hog":
            assert hasattr(importlib.import_module("limo_hog"), node.attr), node.attr
