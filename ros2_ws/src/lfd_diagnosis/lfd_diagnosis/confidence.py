"""Confidence in a fault: counted up while the index is high, down while it is not (eq 26)."""

from math import isnan


class Confidence:
    """A counter between 0 and a ceiling, in steps."""

    def __init__(self, index_threshold: float, fault_threshold: int, ceiling: int) -> None:
        self.index_threshold = index_threshold
        self.fault_threshold = fault_threshold
        self._ceiling = ceiling
        self.value = 0

    @property
    def faulty(self) -> bool:
        """Whether the confidence has reached its threshold (Table 1)."""
        return self.value >= self.fault_threshold

    def step(self, index: float) -> None:
        """Count one step; an undefined index (NaN) starts the count again from zero."""
        if isnan(index):
            self.value = 0
        elif index >= self.index_threshold:
            self.value = min(self.value + 1, self._ceiling)
        else:
            self.value = max(self.value - 1, 0)
