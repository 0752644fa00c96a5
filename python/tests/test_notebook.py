"""The notebook runs, and prints what stands in it."""

import contextlib
import io
import json
import sys
import types

import pytest

from conftest import ROOT

FOLDER = ROOT / "docs" / "python"


@pytest.fixture
def without_ipython(monkeypatch):
    """IPython shows figures; that these are figures is all that is asked here."""
    display = types.ModuleType("IPython.display")
    display.SVG = lambda data: data.startswith(b"<svg") or pytest.fail("no figure")
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)


def test_the_notebook_prints_what_stands_in_it(monkeypatch, without_ipython):
    monkeypatch.chdir(FOLDER)
    cells = json.loads((FOLDER / "tour.ipynb").read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    names = {}
    for cell in code:
        told = "".join(text for out in cell["outputs"] if out.get("name") == "stdout" for text in out["text"])
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec("".join(cell["source"]), names)
        assert printed.getvalue() == told
