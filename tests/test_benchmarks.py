"""The benchmarks run as the code is now: parts of `make bench` that need no graph, made short."""

from collections.abc import Callable
from math import isfinite
from pathlib import Path

import folder
import pytest
import solve
import step
from measure import Figure

PARTS: dict[str, Callable[[Path], list[Figure]]] = {
    "solve": lambda _: solve.measure(None, 20),
    "step": lambda _: step.measure(5.0),
    "folder": lambda work: folder.measure(2, work),
}


@pytest.mark.filterwarnings("ignore:Converted matrix")  # by a solver that is measured beside
@pytest.mark.parametrize("part", PARTS)
def test_a_benchmark_measures_itself_and_its_peer(part: str, tmp_path: Path) -> None:
    figures = PARTS[part](tmp_path)
    assert figures
    for figure in figures:
        assert isfinite(figure.value) and figure.value >= 0.0, figure
        assert isfinite(figure.peer_value) and figure.peer, figure
