"""The last values of a signal, as many as are kept."""

import numpy as np

from lfd_mpc.compiled import inner

LARGEST_RING = 32
"""Values that a ring holds at most."""

RING = np.dtype(
    [("values", "f8", (LARGEST_RING,)), ("size", "i8"), ("count", "i8"), ("next", "i8")], align=True
)
"""The last `size` values of something."""


@inner
def start_ring(ring, size):
    """Begin with no values, of which `size` will be kept, `LARGEST_RING` at most."""
    ring.size, ring.count, ring.next = size, 0, 0


@inner
def append(ring, value):
    """Add a value; the oldest one goes where there are too many."""
    ring.values[ring.next] = value
    ring.next = (ring.next + 1) % ring.size
    ring.count = min(ring.count + 1, ring.size)


@inner
def range_of(ring):
    """How far the values lie apart."""
    least = most = ring.values[0]
    for i in range(1, ring.count):
        least, most = min(least, ring.values[i]), max(most, ring.values[i])
    return most - least


@inner
def is_full(ring):
    """Whether there are as many as are kept."""
    return ring.count == ring.size


@inner
def at(ring, number):
    """The value of that number, 0 = oldest."""
    return ring.values[(ring.next - ring.count + number) % ring.size]


@inner
def mean_of(ring, first, last):
    """Mean of the values from number `first` to before `last`."""
    total = 0.0
    for i in range(first, last):
        total += at(ring, i)
    return total / (last - first)
