"""Rounds in turn, medians and ratios: every figure beside what it is measured against."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import isfinite
from statistics import median

import numpy as np


@dataclass(frozen=True)
class Figure:
    """One line of the table: a value and the peer or floor that was measured in the same run.

    `ratio` is value over peer; `met` is None where no goal is set.
    """

    what: str
    value: float
    unit: str
    peer: str
    peer_value: float
    ratio: float
    goal: str
    met: bool | None

    def as_dict(self) -> dict:
        """For the summary; a ratio to nothing is null."""
        return {**asdict(self), "ratio": self.ratio if isfinite(self.ratio) else None}


def against(
    what: str,
    value: float,
    unit: str,
    peer: str,
    peer_value: float,
    goal: str = "",
    met: Callable[[float, float], bool] | None = None,
) -> Figure:
    """A figure; `met` is asked with the value and the ratio."""
    value, peer_value = float(value), float(peer_value)
    ratio = value / peer_value if peer_value else float("nan")
    good = None if met is None else bool(met(value, ratio))
    return Figure(what, value, unit, peer, peer_value, ratio, goal, good)


def in_turn(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Seconds of each call in each of the rounds, one after the other within a round."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def each(call: Callable[[np.ndarray], object], inputs: list[np.ndarray]) -> list[float]:
    """Seconds of the call with each of the inputs."""
    seconds = []
    for value in inputs:
        start = time.perf_counter()
        call(value)
        seconds.append(time.perf_counter() - start)
    return seconds


def middle(seconds: list[float]) -> float:
    """The median."""
    return median(seconds)


def late(seconds: list[float]) -> float:
    """The 99th percentile."""
    return float(np.quantile(seconds, 0.99))
