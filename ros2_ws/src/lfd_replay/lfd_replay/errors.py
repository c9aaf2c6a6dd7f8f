"""How a user's mistake ends a command: one clear line, exit status 2."""

import sys
from collections.abc import Callable

from lfd_mpc.errors import UserError
from lfd_mpc.starting import INTERRUPTED


class WrongOption(UserError):
    """An option of the command line that what is read has nothing for."""


def refusal(error: Exception) -> str | None:
    """What is said of a user's mistake, in one line; None = it is another kind of failure."""
    if isinstance(error, OSError) and error.filename is not None:
        # Any path may be too long for the system, or in a folder that this user may not enter.
        return f"{error.filename}: {error.strerror}; a path that can be opened is expected"
    return str(error) if isinstance(error, UserError) else None


def run_command(command: Callable[[list[str]], int], arguments: list[str] | None = None) -> int:
    """Run a command line; returns its exit status."""
    try:
        return command(sys.argv[1:] if arguments is None else arguments)
    except BrokenPipeError:
        # The reader of our output has gone: nothing is left to be said.
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        return INTERRUPTED
    except (UserError, OSError) as error:
        said = refusal(error)
        if said is None:
            raise
        print(said, file=sys.stderr)
        return 2
