"""The search for garbage in cycles, put off while there is much to load and none to find."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def without_collector(*, stays: bool = False) -> Iterator[None]:
    """Do not look for cycles meanwhile; nor ever among what was made by then, if it `stays`.

    Looking takes longer than reading a drive does, and a tenth of the start of a node.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if stays:
            gc.freeze()
        if collecting:
            gc.enable()
