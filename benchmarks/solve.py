"""One MPC solve against solvers that people would pick instead."""

from pathlib import Path

import daqp
import numpy as np
import qpsolvers
import quadprog
from drives import long_drive
from measure import Figure, against, each, late, middle

from lfd_mpc.box_qp import BoxQp, solve_box_entry
from lfd_mpc.controller import Controller
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.settings import MpcSettings
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.read_drive import read_drive

ROUNDS = 5


def _linear_terms(drive) -> list[np.ndarray]:
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


def measure(recorded: Path | None, count: int) -> list[Figure]:
    """Medians and 99th percentiles over the same problems, solver after solver in each round."""
    model = build_prediction_model(MpcSettings())
    n = len(model.P)
    lower, upper = np.full(n, -5.0), np.full(n, 3.0)
    P = np.array(model.P)
    drive = read_drive(recorded) if recorded else long_drive(60.0)
    title = "recorded drive" if recorded else "generated drive"
    generator = np.random.default_rng(1)
    active = [
        model.f_error @ (generator.normal(size=2) * [60.0, 20.0])
        + model.f_input * generator.uniform(-5.0, 3.0)
        for _ in range(count)
    ]
    own = BoxQp(P, lower, upper, "active_set", 1e-9)
    at_limits = [f for f in active if np.abs(own.solve(f).u).max() >= 3.0 - 1e-9]
    room = np.empty(n)

    def default(f: np.ndarray) -> object:
        """What a step calls: the answer, and its optimality residual."""
        return solve_box_entry(own.problem, f, room)

    kept = daqp.Model()
    none = np.zeros((0, n))
    kept.setup(P, active[0], none, upper, lower, np.zeros(n, dtype=np.int32))

    def daqp_kept(f: np.ndarray) -> object:
        kept.update(f=f)
        return kept.solve()

    sides = np.hstack([np.eye(n), -np.eye(n)])
    limits = np.concatenate([lower, -upper])

    def by(name: str):
        return lambda f: qpsolvers.solve_qp(P, f, lb=lower, ub=upper, solver=name)

    peers = {
        "DAQP kept": daqp_kept,
        "quadprog": lambda f: quadprog.solve_qp(P, -f, sides, limits),
        **{f"qpsolvers, {name}": by(name) for name in ("proxqp", "osqp", "piqp", "daqp")},
    }
    figures = []
    for what, terms in ((title, _linear_terms(drive)[:count]), ("limits active", at_limits)):
        seconds: dict[str, list[list[float]]] = {"own": [], **{name: [] for name in peers}}
        for _ in range(ROUNDS):
            seconds["own"].append(each(default, terms))
            for name, call in peers.items():
                few = terms if name in ("DAQP kept", "quadprog") else terms[:100]
                seconds[name].append(each(call, few))
        value = {name: np.median([middle(r) for r in rounds]) for name, rounds in seconds.items()}
        tail = {name: np.median([late(r) for r in rounds]) for name, rounds in seconds.items()}
        for name in peers:
            goal = (
                ("at most 1.0", lambda _, ratio: ratio <= 1.0)
                if name == "DAQP kept"
                else ("", None)
            )
            label = f"solve, {what}, median"
            figures.append(against(label, value["own"] * 1e6, "us", name, value[name] * 1e6, *goal))
        label = f"solve, {what}, 99th percentile"
        goal = "at most 2.0", lambda _, ratio: ratio <= 2.0
        peer = tail["DAQP kept"] * 1e6
        figures.append(against(label, tail["own"] * 1e6, "us", "DAQP kept", peer, *goal))
        worst = max(default(f) for f in terms)
        goal = "at most 1e-9", lambda value, _: value <= 1e-9
        label = f"solve, {what}, optimality residual"
        figures.append(against(label, worst, "m/s^2", "the limit", 1e-9, *goal))
    assert Controller(MpcSettings()).qp.own_solver, "what is measured is the default"
    return figures
