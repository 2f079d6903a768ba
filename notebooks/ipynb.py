"""Writes NAME.ipynb beside every percent file NAME.py of this folder, without outputs.

Call it after a change: `python notebooks/ipynb.py`. A test holds the two against each other.
"""

import json
import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
# Jupyter itself comes to these when it saves a notebook of Python.
METADATA = {
    "jupytext": {"formats": "ipynb,py:percent"},
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def percent_files():
    """The notebooks, in their order."""
    return sorted(FOLDER.glob("[0-9]*.py"))


def cells(text):
    """(kind, lines) of each cell of a percent file."""
    found = []
    for line in text.splitlines():
        if marker := re.fullmatch(r"# %%( \[markdown\])?", line):
            found.append(("markdown" if marker[1] else "code", []))
        elif found:
            found[-1][1].append(line)
    for kind, lines in found:
        while lines and not lines[-1]:
            lines.pop()
        if kind == "markdown":
            lines[:] = [re.sub("^# ?", "", line) for line in lines]
    return found


def notebook(text):
    """The document of a percent file, in the format of notebooks, 4.5."""

    def cell(number, kind, lines):
        source = "\n".join(lines).splitlines(keepends=True)
        of_kind = {"execution_count": None, "outputs": []} if kind == "code" else {}
        return {"cell_type": kind, "id": f"cell-{number:02}", "metadata": {}, "source": source, **of_kind}

    numbered = [cell(number, *parts) for number, parts in enumerate(cells(text), 1)]
    return {"cells": numbered, "metadata": METADATA, "nbformat": 4, "nbformat_minor": 5}


def written(text):
    """The bytes of that document, as text."""
    return json.dumps(notebook(text), indent=1, ensure_ascii=False, sort_keys=True) + "\n"


if __name__ == "__main__":
    for path in percent_files():
        path.with_suffix(".ipynb").write_text(written(path.read_text(encoding="utf-8")), encoding="utf-8")
