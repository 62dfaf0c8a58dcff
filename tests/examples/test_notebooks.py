"""The notebooks run from top to bottom, and are kept without outputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

_nbformat: Any = nbformat  # untyped

NOTEBOOKS = Path(__file__).parents[2] / "examples"


def test_both_notebooks_are_here() -> None:
    assert sorted(path.name for path in NOTEBOOKS.glob("*.ipynb")) == ["follow.ipynb", "quickstart.ipynb"]


@pytest.mark.parametrize("name", ["quickstart", "follow"])
def test_a_notebook_is_kept_without_outputs(name: str) -> None:
    cells = code_cells(read(name))
    assert [cell.source for cell in cells if cell.outputs or cell.execution_count] == []


@pytest.mark.parametrize(
    ("name", "pictures", "said"), [("quickstart", 4, "a person at "), ("follow", 2, "contacts_person    0.00")]
)
def test_a_notebook_runs(name: str, pictures: int, said: str) -> None:
    notebook = read(name)
    # An error in a cell raises CellExecutionError, with the traceback.
    NotebookClient(notebook, timeout=200, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == pictures
    assert said in "".join(output.get("text", "") for output in outputs)


def read(name: str) -> Any:
    notebook = _nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    _nbformat.validate(notebook)
    return notebook


def code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]
