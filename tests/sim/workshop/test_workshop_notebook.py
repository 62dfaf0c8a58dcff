"""The workshop's notebook runs from top to bottom in Jupyter, and its cells show pictures and points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from limo_hog.cli.main import main
from limo_sim.workshop import solution, template
from limo_sim.workshop.notebook import check, run

_nbformat: Any = nbformat  # untyped


@pytest.mark.parametrize("node", ["follower", "proxemic"])
def test_a_new_notebook_is_valid_and_holds_the_template(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, node: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["workshop", "new", "--notebook", *(["--sequel"] if node == "proxemic" else [])]) == 0
    notebook = _nbformat.read(tmp_path / f"{node}.ipynb", as_version=4)
    _nbformat.validate(notebook)
    assert template(node).strip() in notebook.cells[2].source


def test_the_notebook_runs_with_the_solution_in_its_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["workshop", "new", "--notebook"]) == 0
    notebook = _nbformat.read("follower.ipynb", as_version=4)
    notebook.cells[2].source = "%%writefile follower.py\n" + solution("follower")
    NotebookClient(notebook, timeout=250, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output["data"] for cell in notebook.cells[3:] for output in cell.get("outputs", ()) if "data" in output]
    assert "data:image/jpeg;base64," in shown[0]["text/html"]
    assert "contacts 0" in shown[0]["text/plain"]
    assert shown[1]["text/plain"] == "follower.py: 100 of 100 points"
    assert "srcdoc=" in shown[1]["text/html"]


def test_a_node_that_fails_shows_its_traceback_and_a_name_that_is_html_stays_text(tmp_path: Path) -> None:
    node = tmp_path / "node.py"
    node.write_text(solution("follower").replace("'Camera'", "'<b>'").replace("middle - cx", "middel - cx"))
    shown = run(node, "standing", 0.5)
    assert "NameError: name 'middel'" in repr(shown)
    assert "&lt;b&gt;" in shown._repr_html_()
    assert "<b>" not in shown._repr_html_()
    assert repr(check(node)) == "node.py: 0 of 100 points"
