"""Confidence in a fault: counted up while the index is high, down while it is not (eq 26)."""

from math import isnan

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.compiled import entry, inner


@inner
def counted(confidence, exceeded, ceiling):
    """Count one step up or down, between 0 and `ceiling`."""
    return min(confidence + 1, ceiling) if exceeded else max(confidence - 1, 0)


@inner
def next_confidence(confidence, index, index_threshold, ceiling):
    """Count one step; an undefined index (NaN) starts from zero again."""
    if isnan(index):
        return 0
    return counted(confidence, index >= index_threshold, ceiling)


@entry
def _count(indices, index_threshold, ceiling, confidences):
    confidence = 0
    for k in range(len(indices)):
        confidence = next_confidence(confidence, indices[k], index_threshold, ceiling)
        confidences[k] = confidence


def confidences(
    indices: NDArray[np.float64], index_threshold: float, ceiling: int
) -> NDArray[np.int64]:
    """Confidence (n,) in steps over n steps with `indices` (n,), from zero on."""
    counted = np.zeros(len(indices), dtype=np.int64)
    _count(np.ascontiguousarray(indices), index_threshold, ceiling, counted)
    return counted
