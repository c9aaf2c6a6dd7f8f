"""One MPC solve against solvers that people would pick instead."""

from collections.abc import Callable
from pathlib import Path

import daqp
import numpy as np
import qpsolvers
import quadprog
from drives import long_drive
from measure import Figure, against, each, late, middle

from lfd_mpc.box_qp import BoxQp, solve_box_entry
from lfd_mpc.controller import Controller
from lfd_mpc.prediction_model import PredictionModel, build_prediction_model
from lfd_mpc.settings import MpcSettings
from lfd_replay.drive import Drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.read_drive import read_drive

ROUNDS = 5

LOWER, UPPER = -5.0, 3.0
"""Limits of the acceleration in m/s^2."""

Solve = Callable[[np.ndarray], object]


def _linear_terms(drive: Drive) -> list[np.ndarray]:
    """The cost's linear term at every tenth step of a drive."""
    model = build_prediction_model(MpcSettings())
    terms = []
    for rows in OfflineGraph(graph_settings("paper")).rows(drive.samples):
        for horizon in rows["horizon"][::10]:
            if horizon["valid"]:
                off = horizon["clearance"] - horizon["desired_clearance"]
                error = np.array([off, horizon["relative_velocity"]])
                terms.append(model.f_error @ error + model.f_input * horizon["acceleration"])
    return terms


def _at_limits(model: PredictionModel, own: BoxQp, count: int) -> list[np.ndarray]:
    """Linear terms of random errors whose answer touches a limit."""
    generator = np.random.default_rng(1)
    terms = [
        model.f_error @ (generator.normal(size=2) * [60.0, 20.0])
        + model.f_input * generator.uniform(-5.0, 3.0)
        for _ in range(count)
    ]
    return [f for f in terms if np.abs(own.solve(f).u).max() >= UPPER - 1e-9]


def _peers(P: np.ndarray) -> dict[str, Solve]:
    """What people would pick instead, by name; the first is kept from problem to problem."""
    n = len(P)
    lower, upper = np.full(n, LOWER), np.full(n, UPPER)
    kept = daqp.Model()
    kept.setup(P, np.zeros(n), np.zeros((0, n)), upper, lower, np.zeros(n, dtype=np.int32))

    def daqp_kept(f: np.ndarray) -> object:
        kept.update(f=f)
        return kept.solve()

    sides = np.hstack([np.eye(n), -np.eye(n)])
    limits = np.concatenate([lower, -upper])

    def by(name: str) -> Solve:
        return lambda f: qpsolvers.solve_qp(P, f, lb=lower, ub=upper, solver=name)

    return {
        "DAQP kept": daqp_kept,
        "quadprog": lambda f: quadprog.solve_qp(P, -f, sides, limits),
        **{f"qpsolvers, {name}": by(name) for name in ("proxqp", "osqp", "piqp", "daqp")},
    }


def _compared(
    what: str, terms: list[np.ndarray], own: Callable[[np.ndarray], float], peers: dict[str, Solve]
) -> list[Figure]:
    """Solver after solver in each round; `own` returns the optimality residual."""
    seconds: dict[str, list[list[float]]] = {"own": [], **{name: [] for name in peers}}
    for _ in range(ROUNDS):
        seconds["own"].append(each(own, terms))
        for name, call in peers.items():
            few = terms if name in ("DAQP kept", "quadprog") else terms[:100]
            seconds[name].append(each(call, few))
    value = {name: np.median([middle(r) for r in rounds]) for name, rounds in seconds.items()}
    tail = {name: np.median([late(r) for r in rounds]) for name, rounds in seconds.items()}
    figures = []
    label = f"solve, {what}, median"
    for name in peers:
        goal = ("at most 1.0", lambda _, ratio: ratio <= 1.0) if name == "DAQP kept" else ()
        figures.append(against(label, value["own"] * 1e6, "us", name, value[name] * 1e6, *goal))
    label = f"solve, {what}, 99th percentile"
    goal = "at most 2.0", lambda _, ratio: ratio <= 2.0
    peer = tail["DAQP kept"] * 1e6
    figures.append(against(label, tail["own"] * 1e6, "us", "DAQP kept", peer, *goal))
    goal = "at most 1e-9", lambda value, _: value <= 1e-9
    label = f"solve, {what}, optimality residual"
    worst = max(own(f) for f in terms)
    return [*figures, against(label, worst, "m/s^2", "the limit", 1e-9, *goal)]


def measure(recorded: Path | None, count: int) -> list[Figure]:
    """Medians and 99th percentiles over the same problems, on a drive and at the limits."""
    assert Controller(MpcSettings()).qp.own_solver, "what is measured is the default"
    model = build_prediction_model(MpcSettings())
    P = np.array(model.P)
    n = len(P)
    own = BoxQp(P, np.full(n, LOWER), np.full(n, UPPER), "active_set", 1e-9)
    room = np.empty(n)

    def default(f: np.ndarray) -> float:
        """What a step calls: the answer, and its optimality residual."""
        return solve_box_entry(own.problem, f, room)

    drive = read_drive(recorded) if recorded else long_drive(60.0)
    title = "recorded drive" if recorded else "generated drive"
    peers = _peers(P)
    return [
        *_compared(title, _linear_terms(drive)[:count], default, peers),
        *_compared("limits active", _at_limits(model, own, count), default, peers),
    ]
