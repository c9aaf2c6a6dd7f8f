"""From verdicts to a fault level: what may still be done with sensors in this state.

| level | when | action |
|---|---|---|
| 0 normal | no sensor in use is faulty or silent | follow |
| 1 degraded | one is, and the others make up for it | follow from afar |
| 2 take over | that has lasted for `take_over_after`, or the lead is not seen | warn |
| 2 take over | `stop_after` later; not seen for `blind_for`, or it braked; no substitute | stop |
| 3 emergency | the lead is reconstructed, and `emergency_deceleration` is not enough | brake |

The lead is not seen where neither of the radar's signals is to be believed, or where they drift
apart: then one of them is wrong, and nothing says which. It is seen again when both are: one that
is believed again beside another that is not has been held against a guess. Where they were but
silent, for less than `blind_for`, the one that was right before is right still.

A level rises at once. It falls when what raised it has been gone for `recover_after`, to the
highest that was wanted since.
"""

from collections import deque
from math import isfinite, nan

from lfd_diagnosis.settings import DecisionSettings
from lfd_diagnosis.verdict import Kind, Reconstruction, Report, State
from lfd_mpc.arrival import AHEAD_NS
from lfd_mpc.decision import Action, Decision, FaultLevel, braking_needed

LOST = (State.FAULT, State.NO_DATA)
"""States of a signal that is not driven by."""

LEAD_SHARE = 0.05
"""Share of a step's estimate in that of the lead's acceleration."""

LEAD_MEMORY = 100
"""Steps of which the hardest braking of the lead is remembered: a fault is not found at once, and
what a held radar says until then makes the lead look steady."""

DOUBTED = (State.SUSPECT, *LOST)
"""States of a signal in whose place the reconstructed one is used where there is one."""


class DecisionMaker:
    """One decision per report."""

    def __init__(self, settings: DecisionSettings) -> None:
        self._settings = settings
        self._level, self._action, self._since = FaultLevel.NORMAL, Action.FOLLOW, 0
        self._stamp: int | None = None
        self._passed = 0
        self._reason, self._deceleration = "", 0.0
        self._lost_since: int | None = None
        self._blind_since: int | None = None
        self._but_silent = False
        self._recent: deque[tuple[int, FaultLevel, Action, str, float]] = deque()
        self._lead_estimate = 0.0
        self._lead_recent: deque[float] = deque(maxlen=LEAD_MEMORY)

    def change(self, settings: DecisionSettings) -> None:
        """Decide by other settings from the next report on."""
        self._settings = settings

    def step(self, report: Report, made: Reconstruction) -> Decision:
        """Answer one report and what was reconstructed with it."""
        self._pass_time(report.stamp)
        self._follow_lead(report, made)
        self._settle(report.stamp, self._wanted(report, made))
        doubted = {
            name: getattr(report, name).state in DOUBTED and isfinite(getattr(made, name))
            for name in ("clearance", "relative_velocity", "acceleration")
        }

        def usable(name: str) -> bool:
            return getattr(report, name).state not in LOST and not doubted[name]

        return Decision(
            report.stamp,
            report.step,
            self._level,
            self._action,
            self._since,
            self._reason,
            self._deceleration,
            usable("clearance"),
            usable("relative_velocity"),
            usable("acceleration"),
            report.host_speed.state not in DOUBTED,
            made.clearance if made.clearance_valid else nan,
            made.relative_velocity if made.relative_velocity_valid else nan,
            made.relative_acceleration if made.relative_acceleration_valid else nan,
            made.acceleration if made.acceleration_valid else nan,
        )

    def _pass_time(self, stamp: int) -> None:
        """Count the ns that have passed; a jump of the clock is no time."""
        if self._stamp is None:
            self._stamp = self._since = stamp
        gone_on, self._stamp = stamp - self._stamp, stamp
        self._since = min(self._since, stamp)
        if 0 < gone_on <= AHEAD_NS:
            self._passed += gone_on

    def _follow_lead(self, report: Report, made: Reconstruction) -> None:
        """How the lead was braking before the radar was lost, in m/s^2."""
        known = report.clearance.state == State.OK and report.relative_velocity.state == State.OK
        relative, own = made.relative_acceleration, made.acceleration
        if known and isfinite(relative) and isfinite(own):
            self._lead_estimate += LEAD_SHARE * (relative + own - self._lead_estimate)
            self._lead_recent.append(self._lead_estimate)
        elif report.radar.state == State.NO_TARGET:
            self._lead_estimate = 0.0
            self._lead_recent.clear()

    @property
    def _lead_acceleration(self) -> float:
        """The hardest braking of the lead before it was lost, in m/s^2."""
        return min(self._lead_recent, default=0.0)

    def _wanted(
        self, report: Report, made: Reconstruction
    ) -> tuple[FaultLevel, Action, str, float]:
        """Level, action, why, and the deceleration of a stop or of emergency braking in m/s^2."""
        settings, now = self._settings, self._passed
        lost = [name for name in ("clearance", "relative_velocity") if _is_lost(report, name)]
        others = [name for name in ("acceleration", "host_speed") if _is_lost(report, name)]
        if not lost:
            self._lost_since = self._blind_since = None
            if others:
                why = _because(report, others)
                return FaultLevel.DEGRADED, Action.FOLLOW_FROM_AFAR, why, 0.0
            return FaultLevel.NORMAL, Action.FOLLOW, "", 0.0
        if self._lost_since is None:
            self._lost_since = now
        drifts = any(getattr(report, name).kind == Kind.RAMP for name in lost)
        unseen = len(lost) == 2 or drifts
        if not unseen and self._was_but_silent():
            self._blind_since = None
        silent = all(getattr(report, name).state == State.NO_DATA for name in lost)
        self._but_silent = unseen and silent and (self._but_silent or self._blind_since is None)
        if unseen and self._blind_since is None:
            self._blind_since = now
        blind = self._blind_since is not None
        why = _because(report, lost + others)
        missing = [name for name in lost if not getattr(made, f"{name}_valid")]
        stopping = settings.stopping_deceleration
        if blind:
            # What the lead does now is not seen; what it did is the least to expect.
            stopping = max(stopping, settings.blind_margin - self._lead_acceleration)
        needed = braking_needed(made.clearance, made.relative_velocity, settings.emergency_room)
        if needed > settings.emergency_deceleration:
            text = f"{needed:.1f} m/s^2 are needed behind the lead"
            braking = settings.emergency_braking
            return FaultLevel.EMERGENCY, Action.BRAKE, f"{text}; {why}", braking
        lost_for = (now - self._lost_since) * 1e-9
        if missing:
            text = f"nothing makes up for {' and '.join(missing)}"
            return FaultLevel.TAKE_OVER, Action.STOP, f"{text}; {why}", stopping
        if self._blind_since is not None:
            blind_for = (now - self._blind_since) * 1e-9
            braking = self._lead_acceleration < -settings.lead_braking
            action = Action.STOP if braking or blind_for >= settings.blind_for else Action.WARN
            text = "the lead was braking" if braking else "the lead is not seen"
            return FaultLevel.TAKE_OVER, action, f"{text}; {why}", stopping
        if lost_for >= settings.take_over_after + settings.stop_after:
            return FaultLevel.TAKE_OVER, Action.STOP, f"not taken over in time; {why}", stopping
        if lost_for >= settings.take_over_after:
            return FaultLevel.TAKE_OVER, Action.WARN, f"it lasts; {why}", stopping
        return FaultLevel.DEGRADED, Action.FOLLOW_FROM_AFAR, why, stopping

    def _was_but_silent(self) -> bool:
        """Whether the lead was not seen for a moment's silence alone."""
        if self._blind_since is None or not self._but_silent:
            return False
        return (self._passed - self._blind_since) * 1e-9 < self._settings.blind_for

    def _settle(self, stamp: int, wanted: tuple[FaultLevel, Action, str, float]) -> None:
        """Rise at once, fall late: the highest of what was wanted lately, as it was last wanted."""
        recent, held = self._recent, (self._level, self._action)
        recent.append((self._passed, *wanted))
        lately = round(self._settings.recover_after * 1e9)
        while self._passed - recent[0][0] > lately:
            recent.popleft()
        _, *settled = max(reversed(recent), key=lambda said: said[1:3])
        self._level, self._action, self._reason, self._deceleration = settled
        if (self._level, self._action) != held:
            self._since = stamp


def _is_lost(report: Report, name: str) -> bool:
    verdict = getattr(report, name)
    if name == "host_speed" and verdict.state == State.NO_DATA:
        # A car without this sensor misses nothing that it had.
        return verdict.kind == Kind.DROPOUT
    return verdict.state in LOST


def _because(report: Report, names: list[str]) -> str:
    return "; ".join(
        f"{name} {getattr(report, name).state.name}: {getattr(report, name).reason}"
        for name in names
    )
