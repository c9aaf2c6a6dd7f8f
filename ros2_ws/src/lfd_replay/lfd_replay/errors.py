"""How a user's mistake ends a command: one clear line, exit status 2."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress

from lfd_mpc.errors import UserError
from lfd_mpc.starting import INTERRUPTED

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says where no more can be written."""


class WrongOption(UserError):
    """An option of the command line that what is read has nothing for."""


def refusal(error: Exception) -> str | None:
    """What is said of a user's mistake, in one line; None = it is another kind of failure."""
    if isinstance(error, OSError) and error.filename is not None:
        # Any path may be too long for the system, or in a folder that this user may not enter.
        return f"{error.filename}: {error.strerror}; a path that can be opened is expected"
    if isinstance(error, OSError) and error.errno in DISK_FULL:
        # A file of ours would have been named: what is left is what is printed.
        return f"the output cannot be written ({error.strerror}); a disk with room is expected"
    return str(error) if isinstance(error, UserError) else None


def _leave_output() -> None:
    """What could not be printed is not tried again at exit, which would say so at length."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def run_command(command: Callable[[list[str]], int], arguments: list[str] | None = None) -> int:
    """Run a command line; returns its exit status."""
    try:
        status = command(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The reader of our output has gone: nothing is left to be said.
        sys.stderr.close()
        _leave_output()
        return 0
    except KeyboardInterrupt:
        return INTERRUPTED
    except (UserError, OSError) as error:
        said = refusal(error)
        if said is None:
            raise
        if isinstance(error, OSError) and error.filename is None:
            _leave_output()
        print(said, file=sys.stderr)
        return 2
