"""Box-constrained quadratic programs by solver name, with a check of every answer.

`minimise 1/2 u'Pu + f'u, lower <= u <= upper` (eq 6). `P` and the limits never change, `f` does.
Where no limit is active the answer is linear in `f`, and no solver is asked.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import numpy as np
import proxsuite
import qpsolvers
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEFAULT_SOLVER = "proxqp"
EXACT_SOLVER = "quadprog"


@dataclass(frozen=True)
class BoxSolution:
    """`u` (N,) in m/s^2, or None; `residual` in m/s^2 (NaN without `u`); `seconds` of wall time."""

    u: Array | None
    status: str
    residual: float
    seconds: float
    fell_back: bool


def available_solvers() -> list[str]:
    """Names that `BoxQp` accepts here; the first is the default."""
    return [DEFAULT_SOLVER, *sorted(set(qpsolvers.available_solvers) - {DEFAULT_SOLVER})]


class BoxQp:
    """One quadratic program solved again and again with another `f`."""

    def __init__(
        self, P: Array, lower: Array, upper: Array, solver: str, residual_limit: float
    ) -> None:
        """`P` (N, N) positive definite and of order one, `lower` and `upper` (N,) in m/s^2.

        Raises ValueError for an unknown solver name or limits that exclude each other.
        """
        if solver not in available_solvers():
            raise ValueError(
                f"solver '{solver}' is not available; available: {', '.join(available_solvers())}"
            )
        if not np.all(lower < upper):
            raise ValueError("the lower acceleration limit must be below the upper one")
        self._P, self._lower, self._upper = np.array(P), np.array(lower), np.array(upper)
        self._minus_inverse = -np.linalg.inv(self._P)
        self._residual_limit = residual_limit
        self._exact = self._by_qpsolvers(EXACT_SOLVER)
        self._solve = self._by_proxqp() if solver == DEFAULT_SOLVER else self._by_qpsolvers(solver)

    def solve(self, f: Array) -> BoxSolution:
        """Solve for `f` (N,); never raises: a failure has `u` None and says why."""
        start = time.perf_counter()
        u: Array | None = self._minus_inverse @ f
        if not ((u >= self._lower) & (u <= self._upper)).all():
            u = self._solve(f)
        residual = self.residual(u, f)
        fell_back = not residual <= self._residual_limit
        if fell_back:
            # The exact solver's own rounding grows with f, so its answer is taken as it is
            # as long as it is no worse than the one that was refused.
            exact = self._exact(f)
            exact_residual = self.residual(exact, f)
            if not residual <= exact_residual:
                u, residual = exact, exact_residual
        seconds = time.perf_counter() - start
        if u is None or not np.isfinite(residual):
            return BoxSolution(None, "no solution found", float("nan"), seconds, fell_back)
        status = f"solved by {EXACT_SOLVER}" if fell_back else "solved"
        return BoxSolution(u, status, residual, seconds, fell_back)

    def residual(self, u: Array | None, f: Array) -> float:
        """Optimality residual `max|u - clip(u - (Pu + f))|` in m/s^2; infinite without `u`."""
        if u is None:
            return float("inf")
        step = np.minimum(np.maximum(u - (self._P @ u + f), self._lower), self._upper)
        residual = float(np.abs(u - step).max())
        return residual if isfinite(residual) else float("inf")

    def _by_proxqp(self) -> Callable[[Array], Array | None]:
        lower, upper = self._lower, self._upper
        n = len(lower)
        qp = proxsuite.proxqp.dense.QP(n, 0, 0, True)
        qp.settings.eps_abs = 1e-11
        qp.settings.eps_rel = 0.0
        # Warm starts of 0.8.0 report "solved" for wrong answers; a cold start does not.
        qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
        qp.init(self._P, np.zeros(n), None, None, None, None, None, lower, upper)

        def solve(f: Array) -> Array | None:
            # The limits must be given again: an update without them drops them.
            qp.update(g=f, l_box=lower, u_box=upper, update_preconditioner=False)
            qp.solve()
            return np.clip(qp.results.x, lower, upper)

        return solve

    def _by_qpsolvers(self, name: str) -> Callable[[Array], Array | None]:
        def solve(f: Array) -> Array | None:
            try:
                u = qpsolvers.solve_qp(self._P, f, lb=self._lower, ub=self._upper, solver=name)
            except (qpsolvers.QPError, ValueError, ArithmeticError):
                return None
            return None if u is None else np.clip(u, self._lower, self._upper)

        return solve
