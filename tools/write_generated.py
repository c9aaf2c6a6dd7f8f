"""Writes what is made from the settings: parameter files, their table, layouts of plots."""

from pathlib import Path

from lfd_bringup.layouts import write_layouts
from lfd_replay.parameter_table import write_parameter_table
from lfd_replay.profiles import write_profile_files
from lfd_vehicle.settings import TABLES

ROOT = Path(__file__).resolve().parent.parent
BRINGUP = ROOT / "ros2_ws/src/lfd_bringup"

write_profile_files(BRINGUP / "params")
write_layouts(BRINGUP / "layouts")
write_parameter_table(ROOT / "docs", TABLES)
