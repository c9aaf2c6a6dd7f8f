"""How an executable starts: one that is told to end while it loads does so without a word.

Loading takes up to a second, all of which is done after this; it imports next to nothing itself.
"""

import os
import signal
from collections.abc import Callable
from importlib import import_module

INTERRUPTED = 130
"""Exit status of a command that was interrupted."""

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def command(module: str) -> Callable[[], int]:
    """The entry point of a command, by the module that has its `main`."""

    def start() -> int:
        before = [signal.getsignal(number) for number in ENDING_SIGNALS]
        _end_when_told(INTERRUPTED)
        main = import_module(module).main
        try:
            for number, handler in zip(ENDING_SIGNALS, before, strict=True):
                signal.signal(number, handler)
            return main()
        except KeyboardInterrupt:
            return INTERRUPTED

    return start


def node(module: str, name: str) -> Callable[[], int]:
    """The entry point of a node, by its module and class; what it computes with is imported when
    it has joined ROS."""

    def start() -> int:
        _end_when_told(0)
        run_node = import_module("lfd_mpc.node_process").run_node
        return run_node(lambda: getattr(import_module(module), name))

    return start


def _end_when_told(status: int) -> None:
    """At once: of an exception, libraries in C that are being loaded make another one."""
    for number in ENDING_SIGNALS:
        # What a shell runs in the background is deaf to SIGINT.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: os._exit(status))
