"""A time by which the process has ended, whatever holds it up."""

import ctypes
import os

_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2


class _Notice(ctypes.Structure):
    """`struct sigevent` of Linux, for a function that is called in a thread of its own."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("way", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("unused", ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """`struct itimerspec`: how often, and when first."""

    _fields_ = tuple(
        (name, ctypes.c_long) for name in ("every_s", "every_ns", "after_s", "after_ns")
    )


class Deadline:
    """Ends the process with a status after so many s, if it is not lifted before.

    The system's timer does it: a library in C that waits for ever may hold Python's lock, so that
    no thread of Python ever runs again.
    """

    def __init__(self, seconds: float, status: int = 0) -> None:
        """Raises OSError if the system has no timer left."""
        self._system = ctypes.CDLL(None, use_errno=True)
        self._timer = ctypes.c_void_p()
        leave = ctypes.cast(self._system._exit, ctypes.c_void_p)
        notice = _Notice(value=status, way=_SIGEV_THREAD, function=leave)
        timer = ctypes.byref(self._timer)
        self._check(self._system.timer_create(_CLOCK_MONOTONIC, ctypes.byref(notice), timer))
        times = _Times(after_s=int(seconds), after_ns=int(seconds % 1.0 * 1e9))
        self._check(self._system.timer_settime(self._timer, 0, ctypes.byref(times), None))

    def lift(self) -> None:
        """The process goes on. To be called once."""
        self._check(self._system.timer_delete(self._timer))

    @staticmethod
    def _check(status: int) -> None:
        if status:
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))
