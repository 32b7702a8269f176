"""The tutorial notebook: clean as committed, and executed from the first cell to the last."""

import asyncio
import json

import pytest
from conftest import ROOT

PATH = ROOT / "tests" / "tutorial.ipynb"


def test_the_committed_notebook_holds_no_output_and_no_path():
    text = PATH.read_text(encoding="utf-8")
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert len(cells) > 8 and all(not cell["outputs"] and cell["execution_count"] is None for cell in cells)
    assert "/home/" not in text and "/tmp/" not in text and "/usr/" not in text


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_notebook_runs_and_shows_latex_and_figures(monkeypatch, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="found no nbclient")
    pytest.importorskip("ipykernel", reason="found no ipykernel")
    nbformat = pytest.importorskip("nbformat", reason="found no nbformat")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = nbformat.read(PATH, as_version=4)
    asyncio.run(nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).async_execute())
    shown = [{kind for output in cell["outputs"] for kind in output.get("data", {})} for cell in notebook.cells if cell["cell_type"] == "code"]
    assert sum("text/latex" in kinds for kinds in shown) >= 8
    assert sum("image/png" in kinds for kinds in shown) == 2
