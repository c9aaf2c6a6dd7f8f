"""Where installed packages keep their files, and where results go."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from lfd_mpc.errors import UserError


def share_folder(package: str) -> Path:
    """The share folder of an installed package."""
    return Path(get_package_share_directory(package))


def named_path(text: str) -> Path:
    """A path of a command line. Raises UserError for an empty one, which would be this folder."""
    if not text:
        raise UserError("'' is no path; the name of a file or a folder is expected")
    return Path(text)


def make_folder(out: Path) -> None:
    """Make the folder in which results are left, before there are any.

    Raises UserError where it cannot be made, or nothing can be written in it.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise UserError(f"--out {out}: cannot be made or written ({error.strerror})") from error


def refuse_to_overwrite(out: Path, inputs: Iterable[Path]) -> None:
    """Raises UserError where what is written would stand in the place of what is read, or in it."""
    place = Path(os.path.realpath(out))
    for path in inputs:
        source = Path(os.path.realpath(path))
        inside = source in place.parents and source.is_dir()
        if place == source or inside or place in source.parents:
            raise UserError(
                f"{out}: would be written over {path}, which is read, or into it; "
                "another place is expected"
            )
