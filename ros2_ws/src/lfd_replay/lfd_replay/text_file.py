"""Text files, written whole or not at all."""

import tempfile
from pathlib import Path

from lfd_mpc.errors import UserError


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            "w", dir=path.parent, prefix=".writing-", delete=False
        ) as file:
            file.write(text)
        Path(file.name).replace(path)
        path.chmod(0o644)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror})") from error
