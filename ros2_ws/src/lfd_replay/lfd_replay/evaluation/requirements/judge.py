"""From windows to findings: the figure, the target, and whether it is met."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass

import numpy as np

from lfd_diagnosis.verdict import COVERS, Kind
from lfd_replay.evaluation.requirements.plan import NOISE
from lfd_replay.evaluation.trace import JUDGED

ONSET = {"clearance": 3.0, "relative_velocity": 2.0, "acceleration": 2.0, "host_speed": 3.0}
"""Errors in m, m/s, m/s^2 and m/s that are dangerous, or that a speed may not have for long."""

OBSERVABLE = 5.0
"""Times the sensor's noise from which on an error must be found."""

MOVED = {"clearance": 0.5, "relative_velocity": 0.3, "acceleration": 0.3, "host_speed": 0.3}
"""Error of a held signal from which on it has moved enough to tell, in its unit."""

OWN = ("acceleration", "host_speed")
"""The signals of the host's own sensors."""

TIMEOUT = 0.2
"""Seconds of silence after which NO_DATA must be said at 20 Hz: 0.15 s, and a scan."""


TO_ITS_END = 0.97
"""Share of a fault's steps that are flagged where it is found and stays found."""

CLEAR_SOON = 1.5
"""Seconds after a fault's end within which its signal must be believed again."""


@dataclass(frozen=True)
class Finding:
    """One figure of one profile; `met` is None where there is only a figure to report."""

    row: str
    what: str
    profile: str
    value: str
    target: str
    met: bool | None

    def as_dict(self) -> dict:
        """For the summary."""
        return asdict(self)


class Judge:
    """Collects findings of one profile on one row."""

    def __init__(self, row: str, profile: str, results: list[dict]) -> None:
        """`results`: what `run_windows` gave for this profile, run by run."""
        self.row, self.profile = row, profile
        self.results = results
        self.windows = [w for result in results for w in result["windows"]]
        self.findings: list[Finding] = []

    def add(self, what: str, value: str, target: str = "", met: bool | None = None) -> None:
        """Add one finding."""
        self.findings.append(Finding(self.row, what, self.profile, value, target, met))

    def share(self, what: str, marks: Iterable[bool], least: float, needed: bool = True) -> None:
        """Share of marks that are true; of none at all nothing can be said, which meets nothing."""
        marks = list(marks)
        if not marks:
            self.add(what, "of none", f"at least {least:.0%}", False if needed else None)
            return
        value = sum(marks) / len(marks)
        self.add(
            what,
            f"{value:.1%} of {len(marks)}",
            f"at least {least:.0%}",
            value >= least if needed else None,
        )

    def of(self, signal: str) -> list[dict]:
        """What was made of one signal in each window that it is faulty in."""
        return [w["signals"][signal] for w in self.windows if signal in w["signals"]]

    def signals(self) -> list[str]:
        """The faulty signals."""
        return list(dict.fromkeys(name for w in self.windows for name in w["signals"]))

    def found(self, signal: str, least: float) -> list[float]:
        """Share of windows in which a signal was flagged anew; returns the delays."""
        delays = [m["delay"] for m in self.of(signal)]
        self.share(f"{signal} found", [delay is not None for delay in delays], least)
        return [delay for delay in delays if delay is not None]

    def middle(self, what: str, delays: list[float], most: float, part: float = 0.5) -> None:
        """Quantile of delays in ms: the median, or the worst one."""
        if delays:
            value = float(np.quantile(delays, part))
            self.add(what, f"{value * 1000:.0f} ms", f"{most * 1000:.0f} ms", value <= most)

    def no_blame(self, least: float = 1.0) -> None:
        """Share of windows in which no healthy signal was flagged."""
        self.share("no healthy signal blamed", [not w["blamed"] for w in self.windows], least)

    def no_false_events(self, per_run: float = 0.0) -> None:
        """Flags where nothing was injected."""
        signals = self.results[0]["false"] if self.results else ()
        events = {name: sum(len(r["false"][name]) for r in self.results) for name in signals}
        total, hours = sum(events.values()), sum(r["hours"] for r in self.results)
        named = ", ".join(f"{n} {name}" for name, n in events.items() if n)
        self.add(
            "false events",
            f"{total} in {hours:.2f} h" + (f" ({named})" if named else ""),
            "none" if not per_run else f"at most {per_run * len(self.results):.0f}",
            total <= per_run * len(self.results),
        )

    def ready(self, least: float | None) -> None:
        """The least share of time in which radar and acceleration were judged; None: a figure."""
        lowest = min((min(r["ready"][name] for name in JUDGED) for r in self.results), default=0.0)
        target = "" if least is None else f"{least:.0%}"
        met = None if least is None else lowest >= least
        self.add("ready, least of all drives", f"{lowest:.1%}", target, met)


def judge_table_3(judge: Judge) -> None:
    """Table 3's faults: exactly the injected signals, soon, for as long, and not longer."""
    for signal in judge.signals():
        delays = judge.found(signal, 1.0)
        if signal == "acceleration":
            judge.middle(f"{signal}, median delay", delays, 0.150)
            judge.middle(f"{signal}, worst delay", delays, 0.200, 1.0)
        else:
            judge.middle(f"{signal}, worst delay", delays, 0.130, 1.0)
        _to_its_end(judge, signal, 1.0)
    judge.no_blame()
    judge.no_false_events()


def judge_offset(judge: Judge) -> None:
    """An offset of one signal alone."""
    (signal,) = judge.signals()
    delays = judge.found(signal, 0.99)
    judge.middle("median delay", delays, 0.300 if signal == "acceleration" else 0.200)
    judge.no_blame(0.98)
    made = _named(judge, signal, Kind.OFFSET)
    judge.share("size right", [_size_right(m) for m in made], 0.90)
    _over(judge)
    judge.no_false_events()


def _named(judge: Judge, signal: str, kind: Kind) -> list[dict]:
    """The windows at whose end the signal was called faulty, and how many named its `kind`."""
    made = [m for m in judge.of(signal) if m["kind"] is not None]
    judge.share("kind named", [m["kind"] == kind for m in made], 0.90)
    return made


def _size_right(made: dict) -> bool:
    """By a fifth, or what it says itself; the sign counts, too."""
    if made["size"] is None:
        return False
    off, size = abs(made["size"] - made["injected"]), abs(made["injected"])
    return off <= max(0.2 * size, made["size_std"] or 0.0)


def judge_found(judge: Judge, delay: float) -> None:
    """Every faulty signal found, within `delay` (s)."""
    for signal in judge.signals():
        delays = judge.found(signal, 0.99)
        judge.middle(f"{signal}, 99 % within", delays, delay, 0.99)
    judge.no_blame(0.98)
    judge.no_false_events()


def judge_long(judge: Judge) -> None:
    """A fault that the reference is coasted through: flagged to its end, over with it."""
    for signal in judge.signals():
        delays = judge.found(signal, 0.99)
        judge.middle(f"{signal}, 99 % within", delays, 0.200, 0.99)
        _to_its_end(judge, signal, 0.99)
    judge.no_blame(0.98)
    judge.no_false_events()


def judge_in_traffic(judge: Judge) -> None:
    """Offsets while targets come and go: figures of all of them, and what must be where one target
    goes on from before the fault until after it."""
    for signal in judge.signals():
        found = [m["delay"] is not None for m in judge.of(signal)]
        judge.share(f"{signal} found, whatever the target", found, 0.99, needed=False)
    _narrow_to_one_target(judge)
    for signal in judge.signals():
        delays = judge.found(signal, 0.99)
        most = 0.300 if signal == "acceleration" else 0.200
        judge.middle(f"{signal}, median delay", delays, most)
    _over(judge)
    judge.no_blame(0.98)


def _narrow_to_one_target(judge: Judge) -> None:
    """Figures of what holds whatever the target; judged further are windows of one target."""
    right = [not w["blamed"] for w in judge.windows]
    judge.share("no healthy signal blamed, whatever the target", right, 0.98, needed=False)
    judge.no_false_events()
    judge.windows = [w for w in judge.windows if w["one_target"]]


def judge_kind_in_traffic(judge: Judge, as_elsewhere: Callable[[Judge], None]) -> None:
    """Other kinds of fault while targets come and go, judged as elsewhere where one target goes on;
    a figure of the blame wherever they do not."""
    _narrow_to_one_target(judge)
    as_elsewhere(judge)
    _over(judge)


def judge_kind(judge: Judge, as_elsewhere: Callable[[Judge], None]) -> None:
    """Another kind of fault, judged as elsewhere, and how soon it is over."""
    as_elsewhere(judge)
    _over(judge)
    judge.no_false_events()


def _over(judge: Judge) -> None:
    """Every fault that was found is over soon after its end."""
    for signal in judge.signals():
        made = judge.of(signal)
        late = sum(m["late"] for m in made)
        if late:
            judge.add(f"{signal} called faulty only once it was over", f"{late} of {len(made)}")
        clear = [is_clear_soon(m) for m in made if m["delay"] is not None]
        if clear:
            judge.share(f"{signal} clear within {CLEAR_SOON:g} s", clear, 0.99)


def judge_blame(judge: Judge) -> None:
    """No healthy signal is blamed."""
    judge.no_blame(0.98)


def _to_its_end(judge: Judge, signal: str, least: float) -> None:
    """Flagged as long as it is faulty, and not much longer."""
    made = judge.of(signal)
    found = [m for m in made if m["delay"] is not None]
    flagged = [m["fraction"] >= TO_ITS_END for m in made]
    judge.share(f"{signal} flagged for {100 * TO_ITS_END:g} %", flagged, least)
    clear = [is_clear_soon(m) for m in found]
    judge.share(f"{signal} clear within {CLEAR_SOON:g} s", clear, least)


def is_clear_soon(made: dict) -> bool:
    """Whether what was made of a signal in a window says that it was believed again in time."""
    return made["clear"] is not None and made["clear"] <= CLEAR_SOON


def judge_held(judge: Judge, kind: Kind) -> None:
    """A signal that is held, or zero: found within 0.5 s of having moved enough to tell."""
    (signal,) = judge.signals()
    judge.share(
        "found within 0.5 s of having moved enough",
        [_told_in_time(m, signal) for m in judge.of(signal) if _moved(m, signal)],
        0.99,
    )
    _named(judge, signal, kind)
    judge.no_blame(0.98)


def _moved(made: dict, signal: str) -> float | None:
    """Seconds after which a held signal has moved enough to tell; None if never.

    What a standing or crawling car's own sensors repeat tells nothing.
    """
    tells = made["drives"] if signal in OWN else [True] * len(made["rms"])
    steps = enumerate(zip(made["rms"], tells, strict=True))
    return next(((k + 1) * 0.1 for k, (e, told) in steps if e > MOVED[signal] and told), None)


def _told_in_time(made: dict, signal: str) -> bool:
    moved = _moved(made, signal)
    return moved is not None and made["delay"] is not None and made["delay"] <= moved + 0.5


def judge_held_radar(judge: Judge) -> None:
    """A radar that says the same again and again: both signals are found, and believed again."""
    for signal in judge.signals():
        told = [_told_in_time(m, signal) for m in judge.of(signal) if _moved(m, signal)]
        judge.share(f"{signal} found within 0.5 s of having moved enough", told, 0.99)
    _over(judge)
    judge.no_blame(0.98)
    judge.no_false_events()


def judge_dropout(judge: Judge) -> None:
    """A sensor that falls silent: NO_DATA, and judged again soon after it is back."""
    for signal in judge.signals():
        made = judge.of(signal)
        judge.share(
            f"{signal}: NO_DATA in time",
            [m["silent_after"] is not None and m["silent_after"] <= TIMEOUT for m in made],
            1.0,
        )
        judge.share(
            f"{signal}: judged again within 0.5 s",
            [m["back_after"] is not None and m["back_after"] <= 0.5 for m in made],
            1.0,
        )
    judge.no_blame()


def judge_ramp(judge: Judge) -> None:
    """A drift: found before its error is dangerous."""
    (signal,) = judge.signals()
    judge.share(
        f"found below {ONSET[signal]:g}",
        [m["at_found"] is not None and m["at_found"] <= ONSET[signal] for m in judge.of(signal)],
        0.95,
    )
    _named(judge, signal, Kind.RAMP)
    judge.no_blame(0.98)


def judge_other(judge: Judge) -> None:
    """Gain, noise and delay: by what their errors are like."""
    (signal,) = judge.signals()
    limit = OBSERVABLE * NOISE[signal]
    dangerous, others, hidden, late = [], [], 0, 0
    for made in judge.of(signal):
        if made["onset"] is not None and made["onset"] > ONSET[signal]:
            dangerous.append(made["delay"] is not None and made["delay"] <= 0.3)
            continue
        seen = next((k * 0.1 for k, e in enumerate(made["rms"]) if e > limit), None)
        if seen is None:
            hidden += 1
        elif seen <= 1.9:
            others.append(made["delay"] is not None and made["delay"] <= seen + 0.1 + 2.0)
        else:
            late += 1
    if dangerous:
        judge.share("dangerous at onset, found within 300 ms", dangerous, 0.99)
    if others:
        judge.share("others found within 2 s of being observable", others, 0.95)
    judge.add("not observable", f"{hidden} windows")
    judge.add("observable for less than 2 s", f"{late} windows")
    judge.no_blame(0.98)
    judge.no_false_events()


def judge_healthy(judge: Judge, ready: float | None = 0.95) -> None:
    """Silent, and not for want of judging; None: how long it was ready is only said."""
    judge.no_false_events()
    judge.ready(ready)


def judge_found_in_views(judge: Judge) -> None:
    """Every faulty signal found and no other one; how soon depends on how often sensors speak."""
    for signal in judge.signals():
        delays = judge.found(signal, 0.99)
        judge.middle(f"{signal}, median delay", delays, 0.200)
    judge.no_blame(0.98)
    judge.no_false_events()


def rms_over_all(rebuilt: list[dict]) -> tuple[float, int]:
    """Error of one signal over the steps of all windows, in its unit (NaN: there was none valid),
    and over how many steps."""
    squares = [(r["rms"] ** 2, r["steps"]) for r in rebuilt if r["rms"] is not None]
    total = sum(steps for _, steps in squares)
    return (sum(s * n for s, n in squares) / total) ** 0.5 if total else float("nan"), total


def judge_rebuilt(judge: Judge, recorded: bool, host_speed: bool = True) -> None:
    """Reconstructed signals while the measured ones are faulty."""
    least = 0.90 if recorded else 0.95
    for signal, limit in (("clearance", 0.5), ("relative_velocity", 0.5), ("acceleration", None)):
        rebuilt = [w["rebuilt"][signal] for w in judge.windows if signal in w["rebuilt"]]
        if not rebuilt:
            continue
        if limit is not None:
            worst = [r["worst"] for r in rebuilt]
            judge.share(
                f"{signal} within {limit:g} for 1 s",
                [value is not None and value <= limit for value in worst],
                least,
            )
        else:
            most = 0.3 if host_speed else 0.7
            rms, _ = rms_over_all(rebuilt)
            judge.add(f"{signal}, rms", f"{rms:.2f} m/s^2", f"at most {most}", rms <= most)
        steps, flagged = sum(r["steps"] for r in rebuilt), sum(r["flagged"] for r in rebuilt)
        if steps:
            judge.add(f"{signal} valid while flagged", f"{steps / flagged:.1%} of {flagged} steps")
            share = sum(r["covered"] for r in rebuilt) / steps
            judge.add(
                f"{signal} covered by {COVERS} std",
                f"{share:.1%} of {steps} steps",
                "93 to 97 %",
                0.93 <= share <= 0.97,
            )


def kinds_confusion(results: dict[str, list[dict]]) -> dict[str, dict[str, int]]:
    """Kind injected against kind named, or that the fault was not found, in all windows; `results`
    by kind injected."""
    table = {}
    for injected, windows in results.items():
        counter: Counter[str] = Counter()
        for window in windows:
            for made in window["signals"].values():
                # A flag that stood before has a kind, too, and one of the last moment has none yet.
                kind = Kind.UNKNOWN if made["kind"] is None else Kind(made["kind"])
                counter["not found" if made["delay"] is None else kind.name.lower()] += 1
        table[injected] = dict(counter)
    return table
