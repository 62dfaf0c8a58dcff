"""The notebooks run from top to bottom, and are kept without outputs."""

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

_nbformat: Any = nbformat  # untyped

NOTEBOOKS = Path(__file__).parents[2] / "examples"


#: Each notebook's pictures, and a part of what it says.
TOLD = {"follow.ipynb": (2, "contacts_person    0.00"), "quickstart.ipynb": (4, "a person at ")}


@pytest.mark.parametrize("name", sorted(path.name for path in NOTEBOOKS.glob("*.ipynb")))
def test_a_notebook_is_kept_without_outputs_and_runs(name: str) -> None:
    notebook = _nbformat.read(NOTEBOOKS / name, as_version=4)
    _nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert cells and [cell.source for cell in cells if cell.outputs or cell.execution_count] == []
    # An error in a cell raises CellExecutionError, with the traceback.
    NotebookClient(notebook, timeout=200, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    outputs = [output for cell in cells for output in cell.outputs]
    pictures, said = TOLD[name]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == pictures
    assert said in "".join(output.get("text", "") for output in outputs)
