"""The verdicts as statuses for /diagnostics; a fault shorter than their period is still seen."""

from math import isnan

from lfd_diagnosis.verdict import EVIDENCE, VERDICTS, Event, Kind, Report, SignalVerdict, State
from lfd_mpc.health import BADNESS, Health, Level

LEVELS = {
    State.OK: Level.OK,
    State.NO_TARGET: Level.OK,
    State.NOT_READY: Level.WARN,
    State.SUSPECT: Level.WARN,
    State.FAULT: Level.ERROR,
    State.NO_DATA: Level.STALE,
}
"""The level of each state."""

HARDWARE = {
    "clearance": "front radar",
    "relative_velocity": "front radar",
    "radar": "front radar",
    "acceleration": "acceleration sensor",
    "host_speed": "host speed sensor",
    "lead_acceleration": "v2v",
}
"""What stands behind each verdict."""


def level_of(name: str, verdict: SignalVerdict) -> Level:
    """The level of a verdict; what is optional and not used, or was never there, is nothing to warn
    of."""
    waits = verdict.state in (State.NO_DATA, State.NOT_READY) and verdict.kind == Kind.UNKNOWN
    return Level.OK if name in EVIDENCE and waits else LEVELS[verdict.state]


class SensorHealth:
    """Keeps the worst that was said of each sensor since the last status."""

    def __init__(self) -> None:
        self._report: Report | None = None
        self._worst: dict[str, SignalVerdict] = {}

    def take(self, report: Report, events: list[Event]) -> None:
        """What was said at a step; a state that nothing changed to is known already."""
        self._report = report
        for event in events:
            worst = self._worst.get(event.signal)
            if worst is None or _badness(event.signal, event.fault) >= _badness(
                event.signal, worst
            ):
                self._worst[event.signal] = event.fault

    def statuses(self, of_period: bool) -> list[Health]:
        """One of each sensor; `of_period`: the worst is forgotten after this."""
        report = self._report
        if report is None:
            return []
        made = []
        for name in VERDICTS:
            now = getattr(report, name)
            worst = self._worst.get(name, now)
            over = _badness(name, worst) > _badness(name, now)
            made.append(_status(name, worst if over else now, now if over else None))
        if of_period:
            self._worst = {}
        return made


def _badness(name: str, verdict: SignalVerdict) -> int:
    return BADNESS[level_of(name, verdict)]


def _status(name: str, verdict: SignalVerdict, now: SignalVerdict | None) -> Health:
    """A status of `verdict`; `now`: what has followed within the same period."""
    message = f"{verdict.state.name}: {verdict.reason}"
    if now is not None:
        message = f"{message} (over: {now.state.name} now)"
    values = {
        "state": verdict.state.name,
        "index": _number(verdict.index),
        "limit of the index": _number(verdict.threshold),
        "confidence": str(verdict.confidence),
        "limit of the confidence": str(verdict.confidence_threshold),
        "since [s]": f"{verdict.since * 1e-9:.2f}",
        "kind": verdict.kind.name,
        "size": _number(verdict.size),
        "deviation of the size": _number(verdict.size_std),
    }
    return Health(name, HARDWARE[name], level_of(name, verdict), message, values)


def _number(value: float) -> str:
    return "none" if isnan(value) else f"{value:.3f}"
