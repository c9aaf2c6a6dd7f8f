"""Text files, written whole or not at all."""

import os
import tempfile
from pathlib import Path

from lfd_mpc.errors import UserError


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all; nothing else is left. Raises UserError.

    A link stays one, and a pipe or a device is written to.
    """
    path = Path(os.path.realpath(path))
    try:
        if path.exists() and not path.is_file():
            path.write_text(text)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
            written = Path(folder) / path.name
            written.write_text(text)
            written.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error
