"""How a user's mistake ends a command: one clear line, exit status 2."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from typing import Any, TextIO

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


class _Printed:
    """A stream that people read: what cannot be printed on it is lost, and nothing else with it.

    A recording, a report or other drives may be unwritten when a line of text cannot be printed.
    """

    def __init__(self, stream: TextIO | None) -> None:
        """`stream`: where it is printed, None where the caller has closed it; `full` is why no more
        can be, where that is a mistake."""
        self._stream = open(os.devnull, "w") if stream is None else stream  # noqa: SIM115
        self.full: OSError | None = None

    def write(self, text: str) -> int:
        """Print, or lose, a text. Raises OSError for what is neither a closed pipe nor a full
        disk."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Print, or lose, what was written. Raises OSError as `write` does."""
        self._attempt(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        """Whatever else is asked of a stream."""
        return getattr(self._stream, name)

    def _attempt(self, printing: Callable[[], object]) -> None:
        try:
            printing()
        except BrokenPipeError:
            # The reader of our output has gone: nothing is left to be said.
            self._leave()
        except OSError as error:
            if error.errno not in DISK_FULL:
                raise
            self.full = error
            self._leave()

    def _leave(self) -> None:
        """What could not be printed is not tried again at exit, which would say so at length."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


def run_command(command: Callable[[list[str]], int], arguments: list[str] | None = None) -> int:
    """Run a command line; returns its exit status.

    What it prints may be cut off by whoever reads it, which is no failure, or by a full disk, which
    is one when all else is done.
    """
    printed = _Printed(sys.stdout), _Printed(sys.stderr)
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
