"""A car for the tests of the robust profile, without ROS."""

from math import isnan, nan

import numpy as np
from test_observer import make_horizon

from lfd_diagnosis.diagnosis import RobustDiagnosis
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Outcome, State
from lfd_observer.bank import ObserverBank
from lfd_observer.settings import BankSettings

SCAN = 5
"""Steps between two scans."""

STALE = 0.16
"""Age in s of a scan that is not used any more."""


class Car:
    """A car behind a lead: radar at 20 Hz, everything else at 100 Hz, a little noise on all."""

    def __init__(self, host_speed: bool = True, lead: bool = False, **settings) -> None:
        self.diagnosis = RobustDiagnosis(DiagnosisSettings(**settings))
        self.bank = ObserverBank(BankSettings())
        self.random = np.random.default_rng(1)
        self.number = 0
        self.host_speed, self.lead = host_speed, lead
        self.accelerometer_silent = self.radar_silent = False
        self.has_target = True
        self.clearance, self.velocity, self.speed = 30.0, 0.0, 15.0
        self.lead_acceleration = 0.0
        self.track_id, self.scan = 1, SCAN
        self.rounded: dict[str, float] = {}
        self.seen: tuple[float, float] = 30.0, 0.0
        self.scanned = -1
        self.outcomes: list[Outcome] = []

    def step(self, **faults: float) -> Outcome:
        """One step; `faults`: added to a signal, or `NAME_is` to put in its place."""
        self.number += 1
        self.velocity += 0.01 * self.lead_acceleration
        self.clearance += 0.01 * self.velocity
        now = self._sense(faults)
        if self.number % self.scan == 1 and not self.radar_silent:
            self.seen, self.scanned = (now["clearance"], now["relative_velocity"]), self.number
        horizon = make_horizon(self.number, **self._of_radar(), **self._of_others(now))
        self.outcomes.append(self.diagnosis.step(horizon, self.bank.step(horizon)))
        return self.outcomes[-1]

    def _sense(self, faults: dict[str, float]) -> dict[str, float]:
        """What every sensor would say now."""
        noise = self.random.normal(size=5).tolist()
        now = {
            "clearance": self.clearance + 0.05 * noise[0],
            "relative_velocity": self.velocity + 0.03 * noise[1],
            "acceleration": 0.08 * noise[2],
            "host_speed": self.speed + 0.01 * noise[3],
            "lead_acceleration": self.lead_acceleration + 0.1 * noise[4],
        }
        for name, resolution in self.rounded.items():
            said = now[name] + faults.pop(name, 0.0)
            now[name] = round(said / resolution) * resolution
        for name in now:
            now[name] = faults.get(f"{name}_is", now[name] + faults.get(name, 0.0))
        return now

    def _of_radar(self) -> dict[str, float]:
        """The horizon's fields of the last scan, carried to now."""
        age = 0.01 * (self.number - self.scanned)
        clearance, velocity = self.seen
        measured = {"measured_clearance": clearance, "measured_relative_velocity": velocity}
        clearance = self.clearance if isnan(clearance) else clearance
        velocity = self.velocity if isnan(velocity) else velocity
        return {
            **measured,
            "clearance": clearance + velocity * age,
            "velocity": velocity,
            "clearance_age": age,
            "relative_velocity_age": age,
            "clearance_stale": age > STALE,
            "relative_velocity_stale": age > STALE,
            "has_target": self.has_target,
            "track_id": self.track_id,
        }

    def _of_others(self, now: dict[str, float]) -> dict[str, float]:
        """Its fields of the other sensors."""
        fields = {
            "acceleration": now["acceleration"],
            "measured_acceleration": now["acceleration"],
            "acceleration_stale": self.accelerometer_silent,
            "measured_host_speed": now["host_speed"] if self.host_speed else nan,
            "host_speed_age": 0.0 if self.host_speed else nan,
            "host_speed_stale": not self.host_speed,
        }
        if self.lead:
            fields |= {
                "measured_lead_acceleration": now["lead_acceleration"],
                "lead_acceleration_age": 0.05,
                "lead_acceleration_stale": False,
            }
        return fields

    def follow_unsteady(self, seconds: int, seed: int) -> None:
        """Behind a lead that accelerates otherwise every second and stays about where it is."""
        random = np.random.default_rng(seed)
        for _ in range(seconds):
            back = 0.05 * (self.clearance - 30.0) + 0.4 * self.velocity
            self.lead_acceleration = float(np.clip(random.normal() - back, -2.5, 2.5))
            self.drive(1.0)

    def drive(self, seconds: float, **faults: float) -> Outcome:
        """Many steps alike; returns the last outcome."""
        for _ in range(round(seconds * 100)):
            outcome = self.step(**faults)
        return outcome

    def go_unheard(self, seconds: float) -> None:
        """Drive on while no input arrives at all, so that there are no steps."""
        self.number += round(seconds * 100)
        self.clearance += seconds * self.velocity

    def brake(self, jerk: float, hardest: float, to: float) -> None:
        """Brake harder by `jerk` m/s^2 in each step up to the `hardest`, down to a speed in m/s."""
        braking = 0.0
        while self.speed > to:
            braking = max(braking - jerk, -hardest)
            self.speed += 0.01 * braking
            self.step(acceleration=braking)

    def drive_off(self, seconds: float) -> None:
        """From rest, accelerating by up to 1.5 m/s^2."""
        for k in range(round(seconds * 100)):
            acceleration = min(0.02 * (k + 1), 1.5)
            self.speed += 0.01 * acceleration
            self.step(acceleration=acceleration)

    def faults_since(self, number: int) -> set[str]:
        """Names of everything that was called faulty after that many steps."""
        return {
            event.signal
            for outcome in self.outcomes[number:]
            for event in outcome.events
            if event.fault.state == State.FAULT
        }

    def delay(self, name: str, since: int) -> float:
        """Seconds from a step to the first verdict of FAULT."""
        for k, outcome in enumerate(self.outcomes[since:]):
            if getattr(outcome.report, name).state == State.FAULT:
                return 0.01 * k
        raise AssertionError(f"{name} was never faulty")
