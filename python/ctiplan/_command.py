"""The command ``ctiplan``."""

from __future__ import annotations

import signal
import sys

from ctiplan import _ctiplan


def main() -> int:
    """Run the command line with the arguments of this process; returns its exit status."""
    # The command is one process, which Ctrl-C ends at once, as it does without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _ctiplan.command(["ctiplan", *sys.argv[1:]])
