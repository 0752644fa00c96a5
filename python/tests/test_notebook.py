"""The notebook runs, and prints what stands in it, but for the last digit of its numbers, in which machines differ."""

import contextlib
import decimal
import io
import json
import re
import sys
import types

import pytest

from conftest import ROOT

FOLDER = ROOT / "docs" / "python"
#: With a point or an exponent; years and counts are words here.
NUMBER = re.compile(r"(?<![\w.])([-+]?\d+(?:\.\d+(?:e[-+]?\d+)?|e[-+]?\d+))(?![\w.]*\d)")


@pytest.fixture
def without_ipython(monkeypatch):
    """IPython shows figures; that these are figures is all that is tested here."""
    display = types.ModuleType("IPython.display")
    display.SVG = lambda data: data.startswith(b"<svg") or pytest.fail("no figure")
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)


def same(shown, printed):
    """Whether words are the same, and numbers within one of their last printed digit."""
    shown, printed = NUMBER.split(shown), NUMBER.split(printed)
    if len(shown) != len(printed) or shown[::2] != printed[::2]:
        return False
    pairs = [(decimal.Decimal(a), decimal.Decimal(b)) for a, b in zip(shown[1::2], printed[1::2])]
    return all(abs(a - b) <= max(decimal.Decimal((0, (1,), n.as_tuple().exponent)) for n in (a, b)) for a, b in pairs)


@pytest.mark.parametrize(
    ("shown", "printed", "alike"),
    [
        ("release_ms = 6.34e+03 +- 3.7e+03 ms", "release_ms = 6.35e+03 +- 3.7e+03 ms", True),
        ("-0.00 e- rms", "0.01 e- rms", True),
        ("6.34e+03 ms", "6.36e+03 ms", False),
        ("6.34e+03 ms", "6.34e+02 ms", False),
        ("35 rows", "36 rows", False),
        ("on 2012-10-22", "on 2012-10-23", False),
        ("0.91 sigma", "0.91 e-", False),
        ("0.91", "0.91 0.91", False),
    ],
)
def test_the_last_digit_may_differ_and_nothing_else(shown, printed, alike):
    assert same(shown, printed) is alike


def test_the_notebook_prints_what_stands_in_it(monkeypatch, without_ipython):
    monkeypatch.chdir(FOLDER)
    cells = json.loads((FOLDER / "tour.ipynb").read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    names = {}
    for cell in code:
        shown = "".join(text for out in cell["outputs"] if out.get("name") == "stdout" for text in out["text"])
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec("".join(cell["source"]), names)
        assert same(shown, printed.getvalue()), f"shown:\n{shown}\nprinted:\n{printed.getvalue()}"
