"""What has been said so far: since when, which states changed, and the radar as a whole."""

from math import isnan

from lfd_diagnosis.verdict import VERDICTS, Event, Report, SignalVerdict, State

_WORST_FIRST = {
    state: rank
    for rank, state in enumerate(
        (
            State.FAULT,
            State.NO_DATA,
            State.NO_TARGET,
            State.NOT_READY,
            State.SUSPECT,
            State.OK,
        )
    )
}


class ReportBook:
    """Turns verdicts into reports and events, whatever the profile."""

    def __init__(self) -> None:
        self._published: dict[str, SignalVerdict] = {}

    def since(self, stamp: int, name: str, state: State) -> int:
        """Since when a signal has been in a state (ns), that of now included."""
        before = self._published.get(name)
        return stamp if before is None or before.state != state else before.since

    def publish(
        self, stamp: int, step: int, verdicts: dict[str, SignalVerdict]
    ) -> tuple[Report, list[Event]]:
        """The report of a step and an event for each state that has changed.

        `verdicts` by name, all of `VERDICTS` but the radar, which is made of its two signals.
        """
        radar = self._radar(stamp, verdicts["clearance"], verdicts["relative_velocity"])
        verdicts = {**verdicts, "radar": radar}
        events = []
        for name in VERDICTS:
            before, verdict = self._published.get(name), verdicts[name]
            old_state = State.NOT_READY if before is None else before.state
            if verdict.state != old_state:
                old_since = stamp if before is None else before.since
                events.append(Event(stamp, name, old_state, old_since, verdict))
            self._published[name] = verdict
        return Report(stamp=stamp, step=step, **verdicts), events

    def _radar(
        self, stamp: int, clearance: SignalVerdict, relative_velocity: SignalVerdict
    ) -> SignalVerdict:
        """The radar is as bad as the worse of its two signals."""
        label, worse = "clearance", clearance
        if _badness(relative_velocity) < _badness(clearance):
            label, worse = "relative velocity", relative_velocity
        return SignalVerdict(
            state=worse.state,
            index=worse.index,
            threshold=worse.threshold,
            confidence=worse.confidence,
            confidence_threshold=worse.confidence_threshold,
            since=self.since(stamp, "radar", worse.state),
            reason=f"{label}: {worse.reason}",
            kind=worse.kind,
        )


def silent(age: float) -> str:
    """Why there is nothing to judge, for a sample of that age in s."""
    return "no sample yet" if isnan(age) else f"no sample for {age:.2f} s"


def _badness(verdict: SignalVerdict) -> tuple[int, int]:
    """Sorts the worst verdict first."""
    return _WORST_FIRST[verdict.state], -verdict.confidence
