"""Runs every notebook of the project from its first cell to its last, and holds its two files against each other."""

import importlib.util
import json
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
SPEC = importlib.util.spec_from_file_location("ipynb", FOLDER / "ipynb.py")
ipynb = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(ipynb)
NOTEBOOKS = ipynb.percent_files()
each = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)


@each
def test_notebook_runs(notebook, monkeypatch, tmp_path):
    matplotlib.use("Agg")
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path))
    runpy.run_path(str(notebook))
    plt.close("all")
    assert list(tmp_path.glob("*.png"))


@each
def test_both_files_are_one_notebook(notebook):
    """Every line of code, and every word, stands in both; nothing has been run and saved."""
    text = notebook.read_text(encoding="utf-8")
    beside = notebook.with_suffix(".ipynb").read_text(encoding="utf-8")
    assert beside == ipynb.written(text), "run python notebooks/ipynb.py"
    cells = json.loads(beside)["cells"]
    # Independently of the code that wrote it: the code cells one after the other are the program.
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    assert [line for line in code.splitlines() if line.strip() and not line.startswith("#")] == lines
    prose = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    assert prose.startswith("# ") and all(not cell.get("outputs") for cell in cells)


def test_there_are_six():
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05", "06"]
