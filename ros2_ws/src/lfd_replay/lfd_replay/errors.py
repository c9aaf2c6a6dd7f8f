"""How a user's mistake ends a command: one clear line, exit status 2."""

import sys
from collections.abc import Callable

from lfd_mpc.errors import UserError


def run_command(command: Callable[[list[str]], int], arguments: list[str] | None = None) -> int:
    """Run a command line; returns its exit status."""
    try:
        return command(sys.argv[1:] if arguments is None else arguments)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader of our output has gone: nothing is left to be said.
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        return 130
