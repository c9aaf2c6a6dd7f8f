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


def end_within(seconds: float, status: int = 0) -> None:
    """Ends the process with a status after so many s, if it has not ended by then.

    The system's timer does it: a library in C that waits for ever may hold Python's lock, so that
    no thread of Python ever runs again. Raises OSError if the system has no timer left.
    """
    system = ctypes.CDLL(None, use_errno=True)
    leave = ctypes.cast(system._exit, ctypes.c_void_p)
    notice = _Notice(value=status, way=_SIGEV_THREAD, function=leave)
    timer = ctypes.c_void_p()
    _check(system.timer_create(_CLOCK_MONOTONIC, ctypes.byref(notice), ctypes.byref(timer)))
    times = _Times(after_s=int(seconds), after_ns=int(seconds % 1.0 * 1e9))
    _check(system.timer_settime(timer, 0, ctypes.byref(times), None))


def _check(status: int) -> None:
    if status:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
