"""The lead as a Kalman filter knows it: clearance, relative velocity, acceleration.

It predicts what the radar should say next and goes on predicting (coasts) while the radar cannot
be believed. The host's own acceleration enters as a known input. Since the lead's acceleration is
estimated all the time, an input that is wrong for good changes that estimate and nothing else: an
accelerometer's fault is not blamed on the radar.
"""

from dataclasses import dataclass


@dataclass
class LeadTrack:
    """Estimate of `clearance` (m), `velocity` (relative, m/s) and `acceleration` (lead, m/s^2).

    `cc` to `aa` are the elements of its covariance, in the units of those.
    """

    clearance: float
    velocity: float
    acceleration: float
    cc: float
    cv: float
    ca: float
    vv: float
    va: float
    aa: float

    @classmethod
    def start(
        cls, clearance: float, velocity: float, acceleration: float, noise: tuple[float, float]
    ) -> "LeadTrack":
        """A track from one scan; `noise` in m and m/s, the lead's acceleration is hardly known."""
        return cls(
            clearance, velocity, acceleration, noise[0] ** 2, 0.0, 0.0, noise[1] ** 2, 0.0, 2.0
        )

    def copy(self) -> "LeadTrack":
        """An estimate of its own."""
        return LeadTrack(*vars(self).values())

    def predict(
        self, dt: float, host_acceleration: float, keep: float, mean: float, jerk: float
    ) -> None:
        """Go on by `dt` s under the host's acceleration in m/s^2.

        The lead's acceleration goes back to `mean` (m/s^2), a share `keep` of the rest remains;
        `jerk` is the density of its random changes in m^2/s^5.
        """
        relative = self.acceleration - host_acceleration
        self.clearance += dt * (self.velocity + 0.5 * dt * relative)
        self.velocity += dt * relative
        self.acceleration = mean + keep * (self.acceleration - mean)
        h = 0.5 * dt * dt
        cc, cv, ca, vv, va, aa = self.cc, self.cv, self.ca, self.vv, self.va, self.aa
        self.cc = cc + 2 * dt * cv + 2 * h * ca + dt * dt * vv + 2 * dt * h * va + h * h * aa
        self.cv = cv + dt * (ca + vv) + (dt * dt + h) * va + dt * h * aa
        self.ca = keep * (ca + dt * va + h * aa)
        self.vv = vv + 2 * dt * va + dt * dt * aa + jerk * dt**3 / 3
        self.va = keep * (va + dt * aa) + jerk * dt * dt / 2
        self.aa = keep * keep * aa + jerk * dt

    def correct_clearance(self, innovation: float, variance: float) -> None:
        """Take a clearance that is off by `innovation` m, of noise `variance` m^2."""
        s = self.cc + variance
        kc, kv, ka = self.cc / s, self.cv / s, self.ca / s
        self.clearance += kc * innovation
        self.velocity += kv * innovation
        self.acceleration += ka * innovation
        cc, cv, ca = self.cc, self.cv, self.ca
        self.cc -= kc * cc
        self.cv -= kc * cv
        self.ca -= kc * ca
        self.vv -= kv * cv
        self.va -= kv * ca
        self.aa -= ka * ca

    def correct_velocity(self, innovation: float, variance: float) -> None:
        """Take a relative velocity that is off by `innovation` m/s, of noise `variance` m^2/s^2."""
        s = self.vv + variance
        kc, kv, ka = self.cv / s, self.vv / s, self.va / s
        self.clearance += kc * innovation
        self.velocity += kv * innovation
        self.acceleration += ka * innovation
        cv, vv, va = self.cv, self.vv, self.va
        self.cc -= kc * cv
        self.cv -= kc * vv
        self.ca -= kc * va
        self.vv -= kv * vv
        self.va -= kv * va
        self.aa -= ka * va

    def believe(self, acceleration: float, deviation: float) -> None:
        """Set the lead's acceleration to what is known better, in m/s^2, and its deviation."""
        self.acceleration = acceleration
        self.ca = self.va = 0.0
        self.aa = deviation * deviation

    def set_clearance(self, clearance: float, variance: float) -> None:
        """Start the clearance anew, in m and m^2."""
        self.clearance, self.cc, self.cv, self.ca = clearance, variance, 0.0, 0.0

    def set_velocity(self, velocity: float, variance: float) -> None:
        """Start the relative velocity anew, in m/s and m^2/s^2."""
        self.velocity, self.vv, self.cv, self.va = velocity, variance, 0.0, 0.0

    def inform(self, acceleration: float, deviation: float) -> None:
        """The lead itself says its acceleration in m/s^2; it may be off for good."""
        self.acceleration = acceleration
        self.aa = deviation * deviation

    def variance(self, velocity: bool) -> float:
        """Variance of the relative velocity (m^2/s^2), or of the clearance (m^2)."""
        return self.vv if velocity else self.cc
