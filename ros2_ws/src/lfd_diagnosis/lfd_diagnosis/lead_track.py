"""The lead as a Kalman filter knows it: clearance, relative velocity, acceleration.

It predicts what the radar should say next and goes on predicting (coasts) while the radar cannot
be believed. The host's own acceleration enters as a known input. Since the lead's acceleration is
estimated all the time, an input that is wrong for good changes that estimate and nothing else: an
accelerometer's fault is not blamed on the radar.
"""

import numpy as np

from lfd_mpc.compiled import inner

UNKNOWN_VARIANCE = 2.0
"""Variance in m^2/s^4 of the acceleration of a lead that comes into view."""

LEAD_TRACK = np.dtype(
    [
        (name, "f8")
        for name in (
            "clearance",
            "velocity",
            "acceleration",
            "cc",
            "cv",
            "ca",
            "vv",
            "va",
            "aa",
        )
    ],
    align=True,
)
"""Estimate of `clearance` (m), `velocity` (relative, m/s) and `acceleration` (lead, m/s^2).

`cc` to `aa` are the elements of its covariance, in the units of those.
"""


@inner
def start_track(track, clearance, velocity, acceleration, clearance_variance, velocity_variance):
    """Begin from one scan, variances in m^2 and m^2/s^2; how the lead accelerates is hardly
    known."""
    track.clearance, track.velocity, track.acceleration = clearance, velocity, acceleration
    track.cc, track.vv, track.aa = clearance_variance, velocity_variance, UNKNOWN_VARIANCE
    track.cv = track.ca = track.va = 0.0


@inner
def predict_track(track, dt, host_acceleration, keep, mean, jerk):
    """Go on by `dt` s under the host's acceleration in m/s^2.

    The lead's acceleration goes back to `mean` (m/s^2), a share `keep` of the rest remains;
    `jerk` is the density of its random changes in m^2/s^5.
    """
    relative = track.acceleration - host_acceleration
    track.clearance += dt * (track.velocity + 0.5 * dt * relative)
    track.velocity += dt * relative
    track.acceleration = mean + keep * (track.acceleration - mean)
    h = 0.5 * dt * dt
    cc, cv, ca, vv, va, aa = track.cc, track.cv, track.ca, track.vv, track.va, track.aa
    track.cc = cc + 2 * dt * cv + 2 * h * ca + dt * dt * vv + 2 * dt * h * va + h * h * aa
    track.cv = cv + dt * (ca + vv) + (dt * dt + h) * va + dt * h * aa
    track.ca = keep * (ca + dt * va + h * aa)
    track.vv = vv + 2 * dt * va + dt * dt * aa + jerk * dt**3 / 3
    track.va = keep * (va + dt * aa) + jerk * dt * dt / 2
    track.aa = keep * keep * aa + jerk * dt


@inner
def clearance_then(track, age, relative_acceleration):
    """The clearance in m `age` s ago, with the relative acceleration since (m/s^2)."""
    return track.clearance - age * (track.velocity - 0.5 * age * relative_acceleration)


@inner
def velocity_then(track, age, relative_acceleration):
    """The relative velocity in m/s `age` s ago, with the relative acceleration since (m/s^2)."""
    return track.velocity - age * relative_acceleration


@inner
def correct_clearance(track, innovation, variance):
    """Take a clearance that is off by `innovation` m, of noise `variance` m^2."""
    cc, cv, ca = track.cc, track.cv, track.ca
    s = cc + variance
    kc, kv, ka = cc / s, cv / s, ca / s
    track.clearance += kc * innovation
    track.velocity += kv * innovation
    track.acceleration += ka * innovation
    track.cc -= kc * cc
    track.cv -= kc * cv
    track.ca -= kc * ca
    track.vv -= kv * cv
    track.va -= kv * ca
    track.aa -= ka * ca


@inner
def correct_velocity(track, innovation, variance):
    """Take a relative velocity that is off by `innovation` m/s, of noise `variance` m^2/s^2."""
    cv, vv, va = track.cv, track.vv, track.va
    s = vv + variance
    kc, kv, ka = cv / s, vv / s, va / s
    track.clearance += kc * innovation
    track.velocity += kv * innovation
    track.acceleration += ka * innovation
    track.cc -= kc * cv
    track.cv -= kc * vv
    track.ca -= kc * va
    track.vv -= kv * vv
    track.va -= kv * va
    track.aa -= ka * va


@inner
def believe(track, acceleration, deviation):
    """Set the lead's acceleration to what is known better, in m/s^2, and its deviation."""
    track.acceleration = acceleration
    track.ca = track.va = 0.0
    track.aa = deviation * deviation


@inner
def set_clearance(track, clearance, variance):
    """Start the clearance anew, in m and m^2."""
    track.clearance, track.cc, track.cv, track.ca = clearance, variance, 0.0, 0.0


@inner
def set_velocity(track, velocity, variance):
    """Start the relative velocity anew, in m/s and m^2/s^2."""
    track.velocity, track.vv, track.cv, track.va = velocity, variance, 0.0, 0.0


@inner
def inform(track, acceleration, deviation):
    """The lead itself says its acceleration in m/s^2; it may be off for good."""
    track.acceleration = acceleration
    track.aa = deviation * deviation
