"""How a user's mistake ends a command: one clear line, exit status 2."""

import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout

from lfd_mpc.errors import UserError
from lfd_mpc.printed import DISK_FULL, Printed, no_room
from lfd_mpc.starting import INTERRUPTED


class WrongOption(UserError):
    """An option of the command line that what is read has nothing for."""


def refusal(error: Exception) -> str | None:
    """What is said of a user's mistake, in one line; None = it is another kind of failure."""
    if isinstance(error, OSError) and error.filename is not None:
        # Any path may be too long for the system, or in a folder that this user may not enter.
        return f"{error.filename}: {error.strerror}; a path that can be opened is expected"
    if isinstance(error, OSError) and error.errno in DISK_FULL:
        # A file of ours would have been named: what is left is what is printed.
        return no_room(error)
    return str(error) if isinstance(error, UserError) else None


def run_command(command: Callable[[list[str]], int], arguments: list[str] | None = None) -> int:
    """Run a command line; returns its exit status.

    What it prints may be cut off by whoever reads it, which is no failure, or by a full disk, which
    is one when all else is done.
    """
    printed = Printed(sys.stdout), Printed(sys.stderr)
    with redirect_stdout(printed[0]), redirect_stderr(printed[1]):
        try:
            status = _status(command, sys.argv[1:] if arguments is None else arguments)
        finally:
            for stream in printed:
                stream.flush()
        for stream in printed:
            if stream.full is not None:
                print(refusal(stream.full), file=sys.stderr)
                status = status or 2
    return status


def _status(command: Callable[[list[str]], int], arguments: list[str]) -> int:
    """Exit status of a command, whose failure is told."""
    try:
        return command(arguments)
    except KeyboardInterrupt:
        return INTERRUPTED
    except (UserError, OSError) as error:
        said = refusal(error)
        if said is None:
            raise
        print(said, file=sys.stderr)
        return 2
