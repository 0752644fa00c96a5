"""Text files that are written whole, and replace nothing unasked."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from ctiplan._errors import InputError


def write(path: str | os.PathLike[str], text: str, *, overwrite: bool) -> None:
    """Write a file whole; an existing one only with `overwrite`."""
    path = Path(path)
    if not overwrite and (path.exists() or path.is_symlink()):
        raise InputError(f"cannot write `{path}`", None, "the file exists already", "give another name, or overwrite=True")
    handle, part = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        # Temporary files are private; results have the permissions of any new file.
        os.chmod(part, 0o644)
        os.replace(part, path)
    except BaseException:
        os.unlink(part)
        raise
