"""The benchmarks run as the code is now: parts of `make bench` that need no graph, made short."""

import operator
import re
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from unittest.mock import patch

import folder
import offline
import pytest
import solve
import step
from measure import Figure

ROOT = Path(__file__).resolve().parent.parent


def offline_when_compiled(work: Path) -> list[Figure]:
    """Without the process that compiles everything first, which takes a minute."""
    with patch.object(offline, "_cold", return_value=1.0):
        return offline.measure(30.0, work, ROOT)


PARTS: dict[str, Callable[[Path], list[Figure]]] = {
    "solve": lambda _: solve.measure(None, 20),
    "step": lambda _: step.measure(5.0),
    "folder": lambda work: folder.measure(2, work),
    "offline": offline_when_compiled,
}


@pytest.mark.filterwarnings("ignore:Converted matrix")  # by a solver that is measured beside
@pytest.mark.parametrize("part", PARTS)
def test_a_benchmark_measures_itself_and_its_peer(part: str, tmp_path: Path) -> None:
    figures = PARTS[part](tmp_path)
    assert figures
    for figure in figures:
        assert isfinite(figure.value) and figure.value >= 0.0, figure
        assert isfinite(figure.peer_value) and figure.peer, figure
        assert figure.met is None or figure.met in meets_as_written(figure), figure


def meets_as_written(figure: Figure) -> set[bool]:
    """Whether ratio and value meet the goal as the table says it, to be compared at sight."""
    goal = re.match(r"at (most|least) ([\d.e-]+)", figure.goal)
    if goal is None:
        return {True, False}
    meets, limit = operator.le if goal[1] == "most" else operator.ge, float(goal[2])
    return {meets(figure.ratio, limit), meets(figure.value, limit)}
