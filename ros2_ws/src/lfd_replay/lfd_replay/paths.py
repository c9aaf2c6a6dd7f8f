"""Where installed packages keep their files."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def share_folder(package: str) -> Path:
    """The share folder of an installed package."""
    return Path(get_package_share_directory(package))
