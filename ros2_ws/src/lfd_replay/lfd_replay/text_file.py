"""Text files, written whole or not at all."""

import os
import tempfile
from pathlib import Path

from lfd_mpc.errors import UserError


def is_stream(path: Path) -> bool:
    """Whether it is a pipe or a device, which is written to and never replaced."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all; nothing else is left. Raises UserError.

    A link stays one, and a pipe or a device is written to.
    """
    try:
        if is_stream(path):
            # By the name that was given: what /dev/stdout leads to is no name of a pipe.
            path.write_text(text)
            return
        path = Path(os.path.realpath(path))
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
            written = Path(folder) / path.name
            written.write_text(text)
            written.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error
