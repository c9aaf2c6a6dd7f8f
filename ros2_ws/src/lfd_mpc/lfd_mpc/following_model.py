"""The horizon that drives the car: seconds long, where the diagnosis' own is a fifth of one.

The clearance answers to the acceleration by its second integral: within 0.2 s a change of 1 m/s^2
moves it by 2 cm. A plan over so short a time sees no lag, no jerk and no limit before it is there.
"""

from typing import NamedTuple

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.box_qp import BoxProblem, box_problem
from lfd_mpc.settings import MpcSettings

STATES = ("error", "relative_velocity", "acceleration", "lead_acceleration", "command")
"""What a plan starts from: clearance less desired clearance (m), m/s, and three times m/s^2; the
last is the command that was sent before."""


class FollowingModel(NamedTuple):
    """`problem` of the commands (N,), `f` (N, 5) of the states, and how errors are paid off.

    `approach` (s): clearance error per closing speed where the plan neither brakes nor speeds up.
    """

    problem: BoxProblem
    f: Array
    approach: float


def build_following_model(settings: MpcSettings) -> FollowingModel:
    """Condense cost and prediction into a box problem of order one.

    With the clearance c, `e = c - c_0 - t_p v`: `e' = v_rel - t_p a`, `v_rel' = a_lead - a`,
    `a' = (u - a) / lag`, `a_lead' = -a_lead / fading`.
    """
    # Imported when it is needed: it takes a node that does not drive longer than all else.
    from scipy.linalg import expm

    n, h = settings.control_steps, settings.control_period
    lag, fading = settings.actuator_lag, settings.lead_acceleration_time
    rates = np.zeros((5, 5))
    rates[0, 1], rates[0, 2] = 1.0, -settings.preview_time
    rates[1, 2], rates[1, 3] = -1.0, 1.0
    rates[2, 2], rates[2, 4] = -1.0 / lag, 1.0 / lag
    rates[3, 3] = -1.0 / fading
    over = expm(rates * h)
    A, B = over[:4, :4], over[:4, 4]
    powers = [np.linalg.matrix_power(A, i) for i in range(n + 1)]
    free = np.stack(powers[1:])
    forced = np.zeros((n, 4, n))
    for i in range(n):
        for j in range(i + 1):
            forced[i, :, j] = powers[i - j] @ B
    weights = np.array(
        [
            settings.control_clearance_weight,
            settings.control_velocity_weight,
            settings.control_acceleration_weight,
            0.0,
        ]
    )
    changes = np.eye(n) - np.eye(n, k=-1)
    P = np.einsum("iaj,a,iak->jk", forced, weights, forced)
    P += settings.control_change_weight * changes.T @ changes
    f = np.zeros((n, 5))
    f[:, :4] = np.einsum("iaj,a,iab->jb", forced, weights, free)
    f[0, 4] = -settings.control_change_weight
    scale = n / np.trace(P)
    P, f = scale * P, scale * f
    gains = np.linalg.solve(P, -f)[0]
    problem = box_problem(
        P, np.full(n, settings.acceleration_lower), np.full(n, settings.comfortable_acceleration)
    )
    return FollowingModel(problem, f, float(gains[1] / gains[0]))
