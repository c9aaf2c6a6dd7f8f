"""Box-constrained quadratic programs by solver name, with a check of every answer.

`minimise 1/2 u'Pu + f'u, lower <= u <= upper` (eq 6). `P` and the limits never change, `f` does.
Where no limit is active the answer is linear in `f`. Where some are, the default solver guesses
which ones after some steps along the gradient, solves for the other inputs exactly, and corrects
its guess by what comes out (primal dual active set); it is right after four rounds, on average.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.compiled import borrowing, entry, inner

DEFAULT_SOLVER = "active_set"
PROXQP = "proxqp"
EXACT_SOLVER = "quadprog"

SOLVED = "solved"
SOLVED_EXACTLY = f"solved by {EXACT_SOLVER}"
NOT_FOUND = "no solution found"

ROUNDS = 30
"""Guesses of the active limits after which the problem goes to the exact solver."""

GRADIENT_STEPS = 5
"""Projected gradient steps before the first guess: each takes a third of the time of a guess, and
five of them save four of eight."""

EXACT = 1e-12
"""Optimality residual at which an answer needs no better guess of the active limits."""


class BoxProblem(NamedTuple):
    """What never changes: `P` and `minus_inverse` (N, N) of it, `lower` and `upper` (N,)."""

    P: Array
    minus_inverse: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class BoxSolution:
    """`u` (N,) in m/s^2, or None; `residual` in m/s^2 (NaN without `u`)."""

    u: Array | None
    status: str
    residual: float
    fell_back: bool


def available_solvers() -> list[str]:
    """Names that `BoxQp` accepts here; the first is the default."""
    import qpsolvers

    others = set(qpsolvers.available_solvers) - {PROXQP}
    return [DEFAULT_SOLVER, PROXQP, *sorted(others)]


def box_problem(P: Array, lower: Array, upper: Array) -> BoxProblem:
    """Prepare a problem; `P` (N, N) positive definite and of order one, limits (N,) in m/s^2.

    Raises ValueError for limits that exclude each other.
    """
    if not np.all(lower < upper):
        raise ValueError("the lower acceleration limit must be below the upper one")
    P = np.array(P)
    return BoxProblem(P, -np.linalg.inv(P), np.array(lower), np.array(upper))


@borrowing
def _times(matrix, vector, result):
    """`matrix @ vector` of a symmetric matrix, row by row so that it is vectorised."""
    result[:] = 0.0
    for j in range(len(vector)):
        for i in range(len(vector)):
            result[i] += matrix[j, i] * vector[j]


@borrowing
def optimality_residual(problem, u, f, gradient):
    """`max|u - clip(u - (Pu + f))|` in m/s^2, infinite where it is no number.

    Leaves `Pu + f` in `gradient`.
    """
    _times(problem.P, u, gradient)
    residual = 0.0
    for i in range(len(u)):
        gradient[i] += f[i]
        step = min(max(u[i] - gradient[i], problem.lower[i]), problem.upper[i])
        off = abs(u[i] - step)
        if not off <= residual:
            residual = off
    return residual if isfinite(residual) else np.inf


@borrowing
def solve_free(problem, f, u):
    """Solve without limits into `u`; whether that keeps all of them."""
    _times(problem.minus_inverse, f, u)
    inside = True
    for i in range(len(u)):
        inside = inside and problem.lower[i] <= u[i] <= problem.upper[i]
    return inside


@borrowing
def _minimise_others(problem, f, side, u, others, factor, y):
    """Minimise over the inputs at no limit (`side` 0), by a Cholesky factor; others at theirs.

    `others`, `factor` and `y` are room to work in. The inner loops run along rows, without sums,
    so that they are vectorised and round the same wherever they are compiled.
    """
    P, n = problem.P, len(f)
    m = 0
    for i in range(n):
        if side[i] == 0:
            others[m] = i
            m += 1
        else:
            u[i] = problem.lower[i] if side[i] < 0 else problem.upper[i]
    for a in range(m):
        i = others[a]
        y[a] = -f[i]
        for b in range(a, m):
            factor[a, b] = P[i, others[b]]
    for j in range(n):
        if side[j] != 0:
            for a in range(m):
                y[a] -= P[j, others[a]] * u[j]
    for k in range(m):
        scale = 1.0 / sqrt(factor[k, k])
        for j in range(k, m):
            factor[k, j] *= scale
        y[k] *= scale
        for i in range(k + 1, m):
            weight = factor[k, i]
            for j in range(i, m):
                factor[i, j] -= weight * factor[k, j]
            y[i] -= weight * y[k]
    for a in range(m - 1, -1, -1):
        value = y[a]
        for c in range(a + 1, m):
            value -= factor[a, c] * u[others[c]]
        u[others[a]] = value / factor[a, a]


@inner
def solve_at_limits(problem, f, u):
    """Solve where `u`, the answer without limits, leaves some; returns the optimality residual."""
    n = len(u)
    side, gradient = np.zeros(n, np.int64), np.empty(n)
    others, factor, y = np.empty(n, np.int64), np.empty((n, n)), np.empty(n)
    for _ in range(GRADIENT_STEPS):
        for i in range(n):
            u[i] = min(max(u[i], problem.lower[i]), problem.upper[i])
        _times(problem.P, u, gradient)
        for i in range(n):
            u[i] -= gradient[i] + f[i]
    for i in range(n):
        side[i] = (u[i] > problem.upper[i]) - (u[i] < problem.lower[i])
    residual = np.inf
    for _ in range(ROUNDS):
        _minimise_others(problem, f, side, u, others, factor, y)
        residual = optimality_residual(problem, u, f, gradient)
        if residual <= EXACT:
            break
        changed = False
        for i in range(n):
            step = u[i] - gradient[i]
            now = (step > problem.upper[i]) - (step < problem.lower[i])
            changed = changed or now != side[i]
            side[i] = now
        if not changed:
            break
    for i in range(n):
        u[i] = min(max(u[i], problem.lower[i]), problem.upper[i])
    return optimality_residual(problem, u, f, gradient)


@inner
def solve_box(problem, f, u):
    """Solve into `u` (N,); returns the optimality residual in m/s^2 (infinite = no answer)."""
    if solve_free(problem, f, u):
        return optimality_residual(problem, u, f, np.empty(len(u)))
    return solve_at_limits(problem, f, u)


@entry
def solve_box_entry(problem, f, u):
    """`solve_box` for callers from outside."""
    return solve_box(problem, f, u)


@entry
def _solve_free(problem, f, u):
    return solve_free(problem, f, u)


@entry
def _residual(problem, u, f):
    return optimality_residual(problem, u, f, np.empty(len(u)))


class BoxQp:
    """One quadratic program solved again and again with another `f`."""

    def __init__(
        self, P: Array, lower: Array, upper: Array, solver: str, residual_limit: float
    ) -> None:
        """`P` (N, N) positive definite and of order one, `lower` and `upper` (N,) in m/s^2.

        Raises ValueError for an unknown solver name or limits that exclude each other.
        """
        if solver != DEFAULT_SOLVER and solver not in available_solvers():
            raise ValueError(
                f"solver '{solver}' is not available; available: {', '.join(available_solvers())}"
            )
        self.problem = box_problem(P, lower, upper)
        self.residual_limit = residual_limit
        self._exact = self._by_qpsolvers(EXACT_SOLVER)
        self._solve: Callable[[Array], Array | None] | None = None
        if solver == PROXQP:
            self._solve = self._by_proxqp()
        elif solver != DEFAULT_SOLVER:
            self._solve = self._by_qpsolvers(solver)

    @property
    def own_solver(self) -> bool:
        """Whether active limits are a matter of `solve_box`, unless its answer is too coarse."""
        return self._solve is None

    def solve(self, f: Array) -> BoxSolution:
        """Solve for `f` (N,); never raises: a failure has `u` None and says why."""
        if not np.isfinite(f).all():
            # proxqp would try for most of a minute.
            return BoxSolution(None, NOT_FOUND, float("nan"), False)
        u: Array | None = np.empty(len(f))
        if self._solve is None:
            residual = solve_box_entry(self.problem, f, u)
        else:
            if not _solve_free(self.problem, f, u):
                u = self._solve(f)
            residual = self.residual(u, f)
        fell_back = not residual <= self.residual_limit
        if fell_back:
            # The exact solver's own rounding grows with f, so its answer is taken as it is
            # as long as it is no worse than the one that was refused.
            exact = self._exact(f)
            exact_residual = self.residual(exact, f)
            if not residual <= exact_residual:
                u, residual = exact, exact_residual
        if u is None or not np.isfinite(residual):
            return BoxSolution(None, NOT_FOUND, float("nan"), fell_back)
        return BoxSolution(u, SOLVED_EXACTLY if fell_back else SOLVED, residual, fell_back)

    def residual(self, u: Array | None, f: Array) -> float:
        """Optimality residual of `u` (N,) for `f` (N,) in m/s^2; infinite without `u`."""
        return np.inf if u is None else _residual(self.problem, np.ascontiguousarray(u), f)

    def _by_proxqp(self) -> Callable[[Array], Array | None]:
        import proxsuite

        P, _, lower, upper = self.problem
        n = len(lower)
        qp = proxsuite.proxqp.dense.QP(n, 0, 0, True)
        qp.settings.eps_abs = 1e-11
        qp.settings.eps_rel = 0.0
        # Warm starts of 0.8.0 report "solved" for wrong answers; a cold start does not.
        qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
        qp.init(P, np.zeros(n), None, None, None, None, None, lower, upper)

        def solve(f: Array) -> Array | None:
            # The limits must be given again: an update without them drops them.
            qp.update(g=f, l_box=lower, u_box=upper, update_preconditioner=False)
            qp.solve()
            return np.clip(qp.results.x, lower, upper)

        return solve

    def _by_qpsolvers(self, name: str) -> Callable[[Array], Array | None]:
        P, _, lower, upper = self.problem

        def solve(f: Array) -> Array | None:
            # Imported when it is needed: that takes a node longer than all else but rclpy.
            import qpsolvers

            try:
                u = qpsolvers.solve_qp(P, f, lb=lower, ub=upper, solver=name)
            except (qpsolvers.QPError, ValueError, ArithmeticError):
                return None
            return None if u is None else np.clip(u, lower, upper)

        return solve
