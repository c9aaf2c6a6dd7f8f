"""make_drive: generates a drive, the same for the same seed."""

import argparse

from lfd_mpc.errors import UserError
from lfd_replay.drive_bag import write_drive
from lfd_replay.errors import run_command
from lfd_replay.generated.generate import generate_drive
from lfd_replay.generated.lead_profiles import NAMES_IN_WORDS, PEAKS
from lfd_replay.generated.sensor_models import SENSORS
from lfd_replay.paths import named_path


def main_make(arguments: list[str]) -> int:
    """The command line of `make_drive`."""
    parser = argparse.ArgumentParser(prog="make_drive", description=__doc__)
    parser.add_argument("name", metavar="NAME", help=f"one of: {NAMES_IN_WORDS}")
    parser.add_argument("--seed", type=int, default=0, help="(default: 0)")
    parser.add_argument(
        "--sensor", default="esr", help=f"one of: {', '.join(SENSORS)} (default: %(default)s)"
    )
    parser.add_argument(
        "--peak",
        type=float,
        help=f"of 'braking', in m/s^2: {PEAKS[0]:g} to {PEAKS[1]:g} (default: -6)",
    )
    parser.add_argument("-o", "--out", type=named_path, required=True, metavar="OUT.mcap")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        raise UserError(f"--seed {options.seed}: a whole number of 0 or more is expected")
    drive = generate_drive(options.name, options.seed, options.sensor, options.peak)
    write_drive(drive, options.out)
    print(f"{options.out}: {drive.duration:.1f} s, {len(drive.samples)} samples")
    return 0


def main() -> int:
    """Entry point of `lfd_replay make_drive`."""
    return run_command(main_make)
