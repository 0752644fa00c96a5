"""Types of the facade, and stubs of the module beneath it."""

import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def run(*arguments, folder=PACKAGE):
    done = subprocess.run([sys.executable, "-m", *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_facade_is_typed():
    run("mypy", "--config-file", "pyproject.toml", "ctiplan")


def test_stubs_are_those_of_the_module(tmp_path):
    # From elsewhere: what is installed, not the sources beside it, which have no module.
    run("mypy.stubtest", "ctiplan._ctiplan", "--mypy-config-file", str(PACKAGE / "pyproject.toml"), folder=tmp_path)
