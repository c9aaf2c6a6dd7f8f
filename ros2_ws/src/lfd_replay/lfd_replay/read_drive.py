"""Any drive by its path: CSV file or bag."""

from pathlib import Path

from lfd_mpc.errors import UserError
from lfd_replay.drive import Drive, make_drive
from lfd_replay.drive_bag import read_bag_streams
from lfd_replay.drive_csv import read_csv_streams

BAG_SUFFIXES = (".mcap", ".db3", ".bag")


def read_drive(path: Path, mapping: dict[str, str] | None = None) -> Drive:
    """Read a drive. Raises UserError with one clear line for anything that is not one."""
    if not path.exists():
        raise UserError(f"{path}: no such file{_neighbours(path)}")
    if path.is_dir() or path.suffix in BAG_SUFFIXES:
        if mapping:
            raise UserError(f"{path}: --map names columns of a CSV drive, and this is a bag")
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            raise UserError(f"{path}: is a folder without metadata.yaml; a bag folder is expected")
        return make_drive(str(path), read_bag_streams(path))
    if path.suffix != ".csv":
        raise UserError(
            f"{path}: is no drive; a .csv file, a bag folder or one of "
            f"{', '.join(BAG_SUFFIXES)} is expected"
        )
    return make_drive(str(path), read_csv_streams(path, mapping or {}))


def _neighbours(path: Path) -> str:
    """What drives are there instead."""
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent} either"
    there = sorted(p.name for p in path.parent.iterdir() if p.suffix in (*BAG_SUFFIXES, ".csv"))
    return f"; in {path.parent} there are: {', '.join(there[:10])}" if there else ""


def parse_mapping(texts: list[str]) -> dict[str, str]:
    """`--map NAME=COLUMN` options as a dictionary. Raises UserError for another form."""
    mapping = {}
    for text in texts:
        name, equals, column = text.partition("=")
        if not (name and equals and column):
            raise UserError(f"--map {text}: NAME=COLUMN is expected")
        mapping[name] = column
    return mapping
