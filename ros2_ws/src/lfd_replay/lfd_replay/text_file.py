"""Text files, written whole or not at all."""

import tempfile
from pathlib import Path

from lfd_mpc.errors import UserError


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all; nothing else is left. Raises UserError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
            written = Path(folder) / path.name
            written.write_text(text)
            written.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from error
