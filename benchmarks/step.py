"""One whole step in Python, as the nodes take it, against a bare matrix-vector product."""

import gc
import time
import tracemalloc
from collections.abc import Sequence

import numpy as np
from drives import long_drive
from measure import Figure, against, middle

from lfd_mpc.samples import Sample
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, graph_settings


def _bare(rounds: int) -> float:
    """Seconds of the prediction's matrix (2N, N) times a vector (N,)."""
    matrix, vector = np.ones((40, 20)), np.ones(20)
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        matrix @ vector
        seconds.append(time.perf_counter() - start)
    return middle(seconds)


def _steps(graph: OfflineGraph, samples: Sequence[Sample]) -> list[float]:
    """Seconds of each step: of its samples, controller, bank and diagnosis."""
    seconds, spent = [], 0.0
    for sample in samples:
        start = time.perf_counter()
        made = list(graph.push(sample))
        spent += time.perf_counter() - start
        if made:
            seconds += [spent / len(made)] * len(made)
            spent = 0.0
    return seconds


def measure(seconds: float) -> list[Figure]:
    """Medians over interleaved rounds, and what memory a second half adds to the first."""
    samples = long_drive(seconds).samples
    figures = []
    found: dict[str, list[float]] = {profile: [] for profile in PROFILES}
    floor = []
    for _ in range(5):
        for profile in PROFILES:
            graph = OfflineGraph(graph_settings(profile))
            found[profile].append(middle(_steps(graph, samples)))
            floor.append(_bare(2000))
    for profile in PROFILES:
        label, peer = f"step, {profile}", "matrix-vector product"
        goal = "at most 100 us", lambda value, _: value <= 100.0
        value, bare = middle(found[profile]) * 1e6, middle(floor) * 1e6
        figures.append(against(label, value, "us", peer, bare, *goal))
    for profile in PROFILES:
        graph = OfflineGraph(graph_settings(profile))
        part = len(samples) // 5
        tracemalloc.start()
        grown = []
        for begin in range(0, 5 * part, part):
            _steps(graph, samples[begin : begin + part])
            gc.collect()
            grown.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
        # The first parts fill what numpy keeps for small arrays.
        goal = "no growth (below 20 KB)", lambda value, _: value < 20.0
        label = f"memory that {part // 3} more steps take, {profile}"
        figures.append(against(label, (grown[4] - grown[3]) / 1e3, "KB", "nothing", 0.0, *goal))
    return figures
