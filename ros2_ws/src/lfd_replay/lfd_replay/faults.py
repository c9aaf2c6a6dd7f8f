"""Faults: their text, and what they do to samples.

The same injector serves the player and the offline evaluation: it sees samples in playing order
and knows nothing of where they come from.
"""

import hashlib
import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite, isnan, nan

import numpy as np

from lfd_mpc.arrival import AHEAD_NS
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_replay.drive import LATEST, stamps_of, streams_of

MEASURED = ("clearance", "relative_velocity", ACCELERATION, HOST_SPEED)
"""The signals that sensors measure and faults act on."""

RADAR_SIGNALS = MEASURED[:2]

WITH_VALUE = ("offset", "ramp", "gain", "noise", "delay", "spike")
WITHOUT_VALUE = ("hold", "zero", "dropout")
KINDS = (*WITH_VALUE, *WITHOUT_VALUE)

GRAMMAR = "KIND:SIGNAL[=VALUE][,SIGNAL=VALUE...]@START-END"


@dataclass(frozen=True)
class Fault:
    """One kind of fault on some signals, `start` included, `end` not, in ns of drive time.

    `values` maps each signal to its value in the unit of the kind, None for kinds without one.
    """

    kind: str
    values: tuple[tuple[str, float | None], ...]
    start: int
    end: int
    text: str
    whole_radar: bool

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that the fault acts on."""
        return tuple(name for name, _ in self.values)


_TIME = r"(\d+(?:\.\d*)?|\.\d+)"
_FAULT = re.compile(rf"\s*([a-z_]+):([^@]+)@{_TIME}-{_TIME}\s*")


def parse_fault(text: str) -> Fault:
    """Parse one fault text. Raises UserError that names what is wrong and what is accepted."""
    match = _FAULT.fullmatch(text)
    if match is None:
        raise UserError(f"fault '{text}': expected {GRAMMAR}, times in seconds")
    kind, assignments, start_text, end_text = match.groups()
    if kind not in KINDS:
        raise UserError(f"fault '{text}': unknown kind '{kind}'; kinds: {', '.join(KINDS)}")
    start, end = float(start_text), float(end_text)
    if not start < end:
        raise UserError(f"fault '{text}': it must start before it ends")
    if end >= LATEST:
        raise UserError(f"fault '{text}': it must end before {LATEST} s")
    values: dict[str, float | None] = {}
    whole_radar = False
    for part in assignments.split(","):
        signal, equals, value_text = (piece.strip() for piece in part.partition("="))
        if signal == RADAR and kind in WITHOUT_VALUE:
            whole_radar = True
            names: tuple[str, ...] = RADAR_SIGNALS
        elif signal in MEASURED:
            names = (signal,)
        else:
            allowed = (*MEASURED, RADAR) if kind in WITHOUT_VALUE else MEASURED
            raise UserError(
                f"fault '{text}': unknown signal '{signal}'; {kind} takes: {', '.join(allowed)}"
            )
        for name in names:
            if name in values:
                raise UserError(f"fault '{text}': {name} is named twice")
            values[name] = _value(text, kind, name, equals, value_text)
    return Fault(
        kind,
        tuple(values.items()),
        round(start * 1e9),
        round(end * 1e9),
        text.strip(),
        whole_radar,
    )


def _value(text: str, kind: str, signal: str, equals: str, value_text: str) -> float | None:
    if kind in WITHOUT_VALUE:
        if equals:
            raise UserError(f"fault '{text}': {kind} takes no value")
        return None
    try:
        value = float(value_text)
    except ValueError:
        value = nan
    if not isfinite(value):
        raise UserError(
            f"fault '{text}': {kind} needs a finite number, {signal}=VALUE; got '{value_text}'"
        )
    if kind in ("noise", "delay") and value < 0:
        raise UserError(f"fault '{text}': the value of {kind} must not be negative, got {value:g}")
    if kind == "delay" and value >= LATEST:
        raise UserError(f"fault '{text}': a delay of less than {LATEST} s is expected")
    return value


def parse_faults(texts: Iterable[str]) -> list[Fault]:
    """Parse fault texts, each of which may hold several separated by semicolons."""
    return [parse_fault(part) for text in texts for part in text.split(";") if part.strip()]


class FaultInjector:
    """Applies faults, in the order given, to samples in playing order."""

    def __init__(self, faults: list[Fault], zero: int, seed: int) -> None:
        """`zero`: the drive's time zero in ns; `seed`: of the noise."""
        self._effects = [
            _Silence(fault, signal, zero)
            if _silences(fault, signal)
            else _Effect(fault, signal, value, zero, seed)
            for fault in faults
            for signal, value in fault.values
        ]

    def __call__(self, sample: Sample) -> Sample | None:
        """The sample as the faulty sensor gives it; None where it says nothing."""
        if isinstance(sample, RadarSample):
            values = {
                "clearance": sample.clearance,
                "relative_velocity": sample.relative_velocity,
            }
            # Without a lead there is nothing that could be measured wrongly.
            measured = values if sample.has_target else {}
        else:
            values = measured = {sample.input: sample.value}
        for effect in self._effects:
            if isinstance(effect, _Silence):
                if effect.holds_back(sample):
                    # The faults after this one never hear of it: they hold and delay what was said.
                    return None
            elif effect.signal in measured:
                measured[effect.signal] = effect(sample.stamp, measured[effect.signal])
        if isinstance(sample, RadarSample):
            return replace(sample, **values)
        return replace(sample, value=values[sample.input])

    def apply(self, samples: Iterable[Sample]) -> list[Sample]:
        """All samples of a drive, in order."""
        changed = (self(sample) for sample in samples)
        return [sample for sample in changed if sample is not None]


def _silences(fault: Fault, signal: str) -> bool:
    """Whether the fault keeps whole messages from coming."""
    if fault.kind != "dropout":
        return False
    return fault.whole_radar or signal not in RADAR_SIGNALS


class _Silence:
    """A fault that keeps an input's messages from coming."""

    def __init__(self, fault: Fault, signal: str, zero: int) -> None:
        self._input = RADAR if signal in RADAR_SIGNALS else signal
        self._start, self._end = zero + fault.start, zero + fault.end

    def holds_back(self, sample: Sample) -> bool:
        return sample.input == self._input and self._start <= sample.stamp < self._end


class _Effect:
    """One fault on one signal."""

    def __init__(
        self, fault: Fault, signal: str, value: float | None, zero: int, seed: int
    ) -> None:
        self.signal = signal
        self._kind = fault.kind
        self._value = 0.0 if value is None else value
        self._start, self._end = zero + fault.start, zero + fault.end
        self._seed = seed
        self._before: float | None = None
        self._spiked: int | None = None
        self._stamps: list[int] = []
        self._history: list[float] = []

    def __call__(self, stamp: int, value: float) -> float:
        if self._kind == "delay":
            if self._stamps and stamp < self._stamps[-1] - AHEAD_NS:
                # Time starts again.
                self._stamps.clear()
                self._history.clear()
            self._stamps.append(stamp)
            self._history.append(value)
        if not self._start <= stamp < self._end:
            if stamp < self._start and isfinite(value):
                self._before = value
            return value
        return getattr(self, f"_{self._kind}")(stamp, value)

    @property
    def holds_nothing(self) -> bool:
        """Whether there was no value yet that it could hold."""
        return self._kind == "hold" and self._before is None

    def _offset(self, stamp: int, value: float) -> float:
        return value + self._value

    def _ramp(self, stamp: int, value: float) -> float:
        return value + self._value * (stamp - self._start) * 1e-9

    def _gain(self, stamp: int, value: float) -> float:
        return value * self._value

    def _noise(self, stamp: int, value: float) -> float:
        digest = hashlib.sha256(f"{self._seed}/{self.signal}/{stamp}".encode()).digest()
        generator = np.random.default_rng(int.from_bytes(digest[:8], "big"))
        return value + self._value * float(generator.standard_normal())

    def _hold(self, stamp: int, value: float) -> float:
        return value if self._before is None else self._before

    def _zero(self, stamp: int, value: float) -> float:
        return 0.0

    def _dropout(self, stamp: int, value: float) -> float:
        return nan

    def _delay(self, stamp: int, value: float) -> float:
        earlier = bisect_right(self._stamps, stamp - round(self._value * 1e9)) - 1
        return self._history[max(earlier, 0)]

    def _spike(self, stamp: int, value: float) -> float:
        second = (stamp - self._start) // 1_000_000_000
        if second == self._spiked:
            return value
        self._spiked = second
        return value + self._value


def spared_signals(
    faults: list[Fault], samples: Iterable[Sample], zero: int
) -> list[dict[str, list[str]]]:
    """For each fault those of its signals that it leaves as they are, by the reason in words."""
    streams = streams_of(samples)
    scans = streams.get(RADAR, [])
    # Without a lead there is nothing that could be measured wrongly.
    streams[RADAR] = [s for s in scans if isinstance(s, RadarSample) and s.has_target]
    stamps = {name: stamps_of(own) for name, own in streams.items()}
    every_scan, never = stamps_of(scans), stamps_of(())

    def why(fault: Fault, signal: str, value: float | None) -> str:
        source = RADAR if signal in RADAR_SIGNALS else signal
        is_silenced = _silences(fault, signal)
        at = every_scan if source == RADAR and is_silenced else stamps.get(source, never)
        within = f"from {fault.start * 1e-9:g} to {fault.end * 1e-9:g} s"
        if not ((zero + fault.start <= at) & (at < zero + fault.end)).any():
            return f"no sample {within}"
        if is_silenced:
            return ""
        effect = _Effect(fault, signal, value, zero, 0)
        values = (
            (s.stamp, getattr(s, signal if source == RADAR else "value")) for s in streams[source]
        )
        if any(not _is_same(effect(stamp, true), true) for stamp, true in values):
            return ""
        if effect.holds_nothing:
            return f"no value before {fault.start * 1e-9:g} s that it could hold"
        return f"every value {within} stays as it is"

    found: list[dict[str, list[str]]] = []
    for fault in faults:
        reasons: dict[str, list[str]] = {}
        for signal, value in fault.values:
            reasons.setdefault(why(fault, signal, value), []).append(signal)
        reasons.pop("", None)
        found.append(reasons)
    return found


def _is_same(one: float, other: float) -> bool:
    return one == other or (isnan(one) and isnan(other))


def truth_windows(faults: list[Fault], signal: str) -> list[tuple[float, float]]:
    """The injected windows of a signal in s of drive time, merged; `radar` is both signals."""
    names = RADAR_SIGNALS if signal == RADAR else (signal,)
    windows = sorted(
        (fault.start * 1e-9, fault.end * 1e-9)
        for fault in faults
        if any(name in fault.signals for name in names)
    )
    merged: list[tuple[float, float]] = []
    for start, end in windows:
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], end)
        else:
            merged.append((start, end))
    return merged
