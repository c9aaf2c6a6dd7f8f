"""What is printed for people to read, where its reader may go, or the disk be full."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TextIO

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says where no more can be written."""


def no_room(error: OSError) -> str:
    """What is said where the disk is full that the output goes to."""
    return f"the output cannot be written ({error.strerror}); a disk with room is expected"


class Printed:
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
