"""All requirements: runs them, judges both profiles, and says what each mechanism contributes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from lfd_replay.evaluation.mishaps import MISHAPS
from lfd_replay.evaluation.random_sensors import RANDOM_SENSORS
from lfd_replay.evaluation.recorded_noise import RECORDED_SENSORS, ROUGHER_SENSORS
from lfd_replay.evaluation.recorded_tracks import (
    BACKWARD,
    COUNT,
    LANES,
    TRACK,
    TRACK_ID,
    TRACK_IDS,
)
from lfd_replay.evaluation.recorded_views import PHONES
from lfd_replay.evaluation.requirements import judge as judges
from lfd_replay.evaluation.requirements import plan
from lfd_replay.evaluation.requirements.judge import Finding, Judge, kinds_confusion
from lfd_replay.evaluation.requirements.plan import Extent
from lfd_replay.evaluation.requirements.windows import NEAREST, Run, run_windows
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.generated.lead_profiles import HILLY, NEW_HILLY, NEW_TRAFFIC, TRAFFIC
from lfd_replay.journal import Task

KINDS = {
    "hold": dict.fromkeys((*JUDGED, "host_speed")),
    "zero": dict.fromkeys((*JUDGED, "host_speed")),
    "dropout": dict.fromkeys((*JUDGED, "host_speed")),
    "ramp": plan.RAMPS,
    "gain": dict.fromkeys(JUDGED, 1.3),
    "noise": {"clearance": 0.56, "relative_velocity": 0.23, "acceleration": 0.8},
    "delay": dict.fromkeys(JUDGED, 0.5),
}
"""Other kinds of fault by signal, with their values; noise is ten times the sensor's own."""

JUDGES = {
    "hold": judges.judge_held,
    "zero": judges.judge_held,
    "dropout": judges.judge_dropout,
    "ramp": judges.judge_ramp,
}
"""How some of them are judged."""

JUDGE_BLIND = partial(judges.judge_healthy, ready=None)
"""Healthy drives without host speed: it takes a lead to be ready there."""

OUTLIERS = (("clearance", 4.0), ("relative_velocity", 5.0), ("acceleration", 4.0))
"""Spikes in m, m/s and m/s^2: the first sample of every second."""


@dataclass(frozen=True)
class Row:
    """One line of the table: what is run and how it is judged."""

    title: str
    runs: tuple[Run, ...]
    judge: Callable[[Judge], None]


def _length_of(kind: str) -> tuple[float, bool]:
    """Seconds of such a fault, and whether it goes either way."""
    return (plan.RAMP_LENGTH, True) if kind == "ramp" else (plan.LENGTH, False)


def _one_signal_in_traffic(title: str, extent: Extent, sensor: str) -> Iterator[Row]:
    """Faults of one signal in traffic as such sensors see it."""
    for signal in plan.OFFSETS:
        values = ((signal, 2.0),)
        runs = plan.faults_in_traffic(extent, "offset", values, True, sensor=sensor)
        yield Row(f"{title}: {signal} +-2", tuple(runs), judges.judge_in_traffic)
    for kind, judge in {**JUDGES, "dropout": judges.judge_blame}.items():
        in_traffic_too = partial(judges.judge_kind_in_traffic, as_elsewhere=judge)
        for signal, value in KINDS[kind].items():
            length, signed = _length_of(kind)
            values = ((signal, value),)
            runs = plan.faults_in_traffic(extent, kind, values, signed, length, sensor=sensor)
            yield Row(f"{title}: {kind} {signal}", tuple(runs), in_traffic_too)


def _among_hills(title: str, extent: Extent, sensor: str) -> Iterator[Row]:
    """Traffic among hills as such sensors see it."""
    runs = plan.in_traffic(extent, sensor, drives=HILLY)
    yield Row(f"{title}: healthy", tuple(runs), judges.judge_healthy)
    blind = plan.in_traffic(extent, sensor, host_speed=False, drives=HILLY)
    yield Row(f"{title}, no host speed: healthy", tuple(blind), JUDGE_BLIND)
    for size in (2.0, 4.0):
        values = (("acceleration", size),)
        runs = plan.faults_in_traffic(extent, "offset", values, True, sensor=sensor, drives=HILLY)
        yield Row(f"{title}: acceleration +-{size:g}", tuple(runs), judges.judge_in_traffic)


NEW = {"in new traffic": NEW_TRAFFIC, "among new hills": NEW_HILLY}
"""Drives that nothing was chosen on, by where they are."""


def _on_new_roads(extent: Extent, sensors: dict[str, str]) -> Iterator[Row]:
    """Healthy drives on roads that were not looked at while mending, as each sensor sees them."""
    once = replace(extent, healthy_seeds=extent.healthy_seeds[:1])
    for name, sensor in sensors.items():
        for where, drives in NEW.items():
            runs = plan.in_traffic(once, sensor, drives=drives)
            yield Row(f"{name} {where}: healthy", tuple(runs), judges.judge_healthy)


def rows(extent: Extent, recorded: bool) -> list[Row]:
    """Everything but ablation and V2V."""
    made: list[Row] = []

    def add(title: str, runs: list[Run], judge: Callable[[Judge], None]) -> None:
        if runs:
            made.append(Row(title, tuple(runs), judge))

    for name, values in plan.COMBINATIONS.items():
        runs = plan.table_3(extent, values, recorded)
        add(f"Table 3: {name}", runs, judges.judge_table_3)
        generated = [run for run in runs if run.drive.startswith("data")]
        add(f"Table 3: {name}, rebuilt", generated, partial(judges.judge_rebuilt, recorded=False))
        others = [run for run in runs if run not in generated]
        add(
            f"Table 3: {name}, rebuilt, recorded",
            others,
            partial(judges.judge_rebuilt, recorded=True),
        )
    rebuilt = partial(judges.judge_rebuilt, recorded=False)
    for signal, sizes in plan.OFFSETS.items():
        runs_of_signal = []
        for size in sizes:
            runs = plan.spread("offset", ((signal, size),), extent.normal, extent.seeds)
            runs_of_signal += runs
            title = f"offset {signal} +-{size:g}"
            add(title, runs, judges.judge_offset)
        add(f"offset {signal}, rebuilt", runs_of_signal, rebuilt)
    radar = plan.PAPER[:2]
    long = plan.spread("offset", radar, extent.normal, extent.seeds, plan.LONG_LENGTH, signed=False)
    add("both radar signals for 8 s", long, judges.judge_long)
    add("both radar signals for 8 s, rebuilt", long, rebuilt)
    if recorded:
        of_recorded = partial(judges.judge_rebuilt, recorded=True)
        for name, values in plan.COMBINATIONS.items():
            runs = plan.real(extent, "offset", values, signed=False)
            add(f"real leads: {name}", runs, judges.judge_long)
            add(f"real leads: {name}, rebuilt", plan.as_driven(runs), of_recorded)
        for signal in plan.OFFSETS:
            runs = plan.real(extent, "offset", ((signal, 2.0),), signed=True)
            add(f"real leads: {signal} +-2", runs, judges.judge_offset)
            add(f"real leads: {signal} +-2, rebuilt", plan.as_driven(runs), of_recorded)
        for kind, judge in JUDGES.items():
            for signal, value in KINDS[kind].items():
                length, signed = _length_of(kind)
                runs = plan.real(extent, kind, ((signal, value),), signed, length)
                add(
                    f"real leads: {kind} {signal}",
                    runs,
                    partial(judges.judge_kind, as_elsewhere=judge),
                )
        title = "other sensors of the recorded car"
        add(f"{title}: healthy", plan.views(extent, True), judges.judge_healthy)
        blind = plan.views(extent, False)
        add(f"{title}, no host speed: healthy", blind, JUDGE_BLIND)
        for name, values in plan.COMBINATIONS.items():
            runs = plan.faults_in_views(extent, values)
            add(f"{title}: {name}", runs, judges.judge_found_in_views)
        title = "recorded sensors on generated leads"
        add(f"{title}: healthy", plan.recorded_sensors_healthy(extent), judges.judge_healthy)
        traffic = plan.in_traffic(extent, RECORDED_SENSORS)
        add("recorded sensors in traffic: healthy", traffic, judges.judge_healthy)
        runs = plan.faults_in_traffic(extent, "offset", radar, False, sensor=RECORDED_SENSORS)
        name = "clearance and relative velocity"
        add(f"recorded sensors in traffic: {name}", runs, judges.judge_in_traffic)
        rougher = plan.in_traffic(extent, ROUGHER_SENSORS)
        add("rougher sensors in traffic: healthy", rougher, judges.judge_healthy)
        for name, values in plan.COMBINATIONS.items():
            runs = plan.faults_in_traffic(extent, "offset", values, False, sensor=ROUGHER_SENSORS)
            add(f"rougher sensors in traffic: {name}", runs, judges.judge_in_traffic)
        for mishap in MISHAPS:
            runs = [replace(run, mishap=mishap) for run in traffic]
            add(f"in traffic, {mishap}: healthy", runs, judges.judge_healthy)
        made += _one_signal_in_traffic("recorded sensors in traffic", extent, RECORDED_SENSORS)
        for name, values in plan.COMBINATIONS.items():
            runs = plan.recorded_sensors(extent, values, signed=False)
            add(f"{title}: {name}", runs, judges.judge_long)
            add(f"{title}: {name}, rebuilt", runs, rebuilt)
        for signal in plan.OFFSETS:
            runs = plan.recorded_sensors(extent, ((signal, 2.0),), signed=True)
            add(f"{title}: {signal} +-2", runs, judges.judge_offset)
            add(f"{title}: {signal} +-2, rebuilt", runs, rebuilt)
        made += _among_hills("recorded sensors among hills", extent, RECORDED_SENSORS)
        title = "a phone in traffic"
        add(f"{title}: healthy", plan.phones_in_traffic(extent, True), judges.judge_healthy)
        blind = plan.phones_in_traffic(extent, False)
        add(f"{title}, no host speed: healthy", blind, JUDGE_BLIND)
        runs = plan.faults_by_phones_in_traffic(extent, plan.PAPER[2:])
        add(f"{title}: acceleration", runs, judges.judge_in_traffic)
        # Joined to a table it would be the same road, felt less well.
        made += _among_hills("a phone among hills", extent, PHONES[0])
        sensors = {"recorded sensors": RECORDED_SENSORS, "a phone": PHONES[0]}
        made += _on_new_roads(extent, sensors)
    title = "random sensors in traffic"
    add(f"{title}: healthy", plan.in_traffic(extent, RANDOM_SENSORS), judges.judge_healthy)
    blind = plan.in_traffic(extent, RANDOM_SENSORS, host_speed=False)
    add(f"{title}, no host speed: healthy", blind, JUDGE_BLIND)
    for name, values in plan.COMBINATIONS.items():
        runs = plan.faults_in_traffic(extent, "offset", values, False, sensor=RANDOM_SENSORS)
        add(f"{title}: {name}", runs, judges.judge_in_traffic)
    made += _one_signal_in_traffic(title, extent, RANDOM_SENSORS)
    made += _among_hills("random sensors among hills", extent, RANDOM_SENSORS)
    made += _on_new_roads(extent, {"random sensors": RANDOM_SENSORS})
    held = tuple((signal, None) for signal, _ in radar)
    frozen = plan.spread("hold", held, extent.few, extent.seeds, plan.LENGTH, signed=False)
    add("the whole radar held", frozen, judges.judge_held_radar)
    blind = plan.spread("offset", plan.PAPER[2:], extent.few, extent.seeds, host_speed=False)
    add(
        "without host speed: acceleration +-4",
        blind,
        partial(judges.judge_found, least=0.99, delay=0.2),
    )
    add(
        "without host speed: acceleration +-4, rebuilt",
        blind,
        partial(judges.judge_rebuilt, recorded=False, host_speed=False),
    )
    for kind, by_signal in KINDS.items():
        for signal, value in by_signal.items():
            length, signed = _length_of(kind)
            runs = plan.spread(
                kind, ((signal, value),), extent.few, extent.seeds[:1], length, signed
            )
            judge = judges.judge_other
            if kind in JUDGES:
                judge = partial(judges.judge_kind, as_elsewhere=JUDGES[kind])
            add(f"{kind} {signal}", runs, judge)
    for signal, value in OUTLIERS:
        runs = plan.spread("spike", ((signal, value),), extent.few, extent.seeds[:1])
        add(f"single outliers of {signal}", runs, partial(_judge_outliers, signal=signal))
    add("healthy drives", plan.healthy(extent, recorded), judges.judge_healthy)
    add(
        "braking leads without host speed",
        plan.braking_blind(extent),
        lambda judge: judge.no_false_events(1.0),
    )
    for sensor in plan.OTHER_SENSORS:
        add(
            f"sensor {sensor}: healthy",
            plan.other_sensors_healthy(extent, sensor),
            judges.judge_healthy,
        )
        for name, values in plan.COMBINATIONS.items():
            add(
                f"sensor {sensor}: {name}",
                plan.spread(
                    "offset", values, extent.few, extent.seeds[:1], signed=False, sensor=sensor
                ),
                partial(judges.judge_found, least=0.99, delay=0.3),
            )
    if recorded:
        tracks = [Run(f"{TRACK}{number}", 0) for number in range(COUNT)]
        add("every track of the recorded radar", tracks, judges.judge_healthy)
        ids = [Run(f"{TRACK_ID}{number}", 0) for number in TRACK_IDS]
        add("every id of the recorded radar", ids, partial(judges.judge_healthy, ready=0.8))
        lanes = [Run(f"{way}{lane}", 0) for lane in LANES for way in ("", BACKWARD)]
        add("nearest in other lanes", lanes, partial(judges.judge_healthy, ready=0.5))
        add("nearest in path", [Run(NEAREST, 0)], partial(judges.judge_healthy, ready=0.8))
        for name, values in plan.COMBINATIONS.items():
            add(
                f"nearest in path: {name}",
                plan.nearest(values),
                partial(judges.judge_found, least=0.99, delay=0.2),
            )
    return made


def _judge_outliers(judge: Judge, signal: str) -> None:
    """Outliers of one sample are no faults."""
    flagged = [m["delay"] is not None for m in judge.of(signal)]
    judge.share("not taken for a fault", [not flag for flag in flagged], 0.99)
    judge.no_blame()


LONG = (("clearance", 2.0), ("relative_velocity", -4.0))
"""Offsets in m and m/s that a coasted track cannot tell for long."""

V2V_SIZES = (1.5, 2.0, 4.0)
"""Offsets of the acceleration in m/s^2 that are looked for without host speed."""


def v2v_rows(extent: Extent) -> list[Row]:
    """What the lead's word gains, and that a lie makes nothing worse."""
    made = []
    for lead in ("nothing", "the truth", "a lie"):
        # With nothing said there is nothing to change, but the paper profile is of no interest.
        more = {"lead": lead, "changes": (("use_lead_report", True),)}
        for size in V2V_SIZES:
            values = (("acceleration", size),)
            runs = plan.spread(
                "offset", values, extent.few, extent.seeds[:1], host_speed=False, **more
            )
            title = f"V2V says {lead}: acceleration +-{size:g} without host speed"
            made.append(Row(title, tuple(runs), _judge_v2v_offset))
        runs = plan.spread("offset", plan.PAPER[:2], extent.few, extent.seeds[:1], **more)
        title = f"V2V says {lead}: clearance and relative velocity"
        made.append(Row(title, tuple(runs), _judge_v2v_rebuilt))
        drives = [
            Run(name, seed, host_speed=False, **more)
            for name in extent.few
            for seed in extent.healthy_seeds
        ]
        made.append(Row(f"V2V says {lead}: healthy", tuple(drives), _judge_v2v_healthy))
    return made


def _judge_v2v_offset(judge: Judge) -> None:
    found = [m["delay"] is not None for m in judge.of("acceleration")]
    judge.share("found", found, 0.99, needed=False)
    judge.no_false_events()


def _judge_v2v_rebuilt(judge: Judge) -> None:
    """How far off the coasted signals are, over all that was valid."""
    for signal in ("clearance", "relative_velocity"):
        rebuilt = [w["rebuilt"][signal] for w in judge.windows]
        steps = [(r["rms"] ** 2, r["steps"]) for r in rebuilt if r["rms"] is not None]
        total = sum(n for _, n in steps)
        rms = (sum(s * n for s, n in steps) / total) ** 0.5 if total else float("nan")
        judge.add(f"{signal} rebuilt over 4 s, rms", f"{rms:.2f}")
        flagged = sum(r["flagged"] for r in rebuilt)
        judge.add(f"{signal} valid meanwhile", f"{total / max(flagged, 1):.1%} of {flagged} steps")
    judge.no_false_events()


def _judge_v2v_healthy(judge: Judge) -> None:
    judge.no_false_events()


MECHANISMS: dict[str, tuple[tuple[str, object], ...]] = {
    "as it is": (("latch", True),),
    "no learnt noise": (("learn_noise", False),),
    "no check of roughness": (("check_roughness", False),),
    "no check of repetition": (("check_repetition", False),),
    "no check of drift": (("check_drift", False),),
    "every new id a new car": (("same_car", False),),
    "no host speed": (("use_host_speed", False),),
    "no observers (and no host speed)": (("use_host_speed", False), ("use_observers", False)),
    "observers not restarted (and no host speed)": (
        ("use_host_speed", False),
        ("restart_error", 0.0),
    ),
    "no bends of the road": (("steepest_road", 0.0),),
    "no latch": (("latch", False),),
    "no V2V (and no host speed)": (("use_host_speed", False), ("use_lead_report", False)),
    "V2V (and no host speed)": (("use_host_speed", False), ("use_lead_report", True)),
}
"""Each mechanism switched off, by settings of the robust profile."""


def ablation_runs(extent: Extent, recorded: bool) -> dict[str, list[Run]]:
    """What the mechanisms are judged on, by title; small, since it is run for each of them."""
    drive = extent.few[1:2]
    groups = {
        "offsets of single signals": [
            run
            for signal, sizes in plan.OFFSETS.items()
            for run in plan.spread("offset", ((signal, sizes[0]),), drive, (1,))
        ],
        "Table 3": plan.spread("offset", plan.PAPER, drive, (1,), 8.0, signed=False),
        "faults of 20 s": plan.spread("offset", LONG, drive, (1,), 20.0, signed=False),
        "clearance of a coarse sensor": plan.spread(
            "offset", (("clearance", 2.0),), drive, (1,), sensor="coarse"
        ),
        "held signals": [
            run for signal in JUDGED for run in plan.spread("hold", ((signal, None),), drive, (1,))
        ],
        "noise": [
            run
            for signal, value in KINDS["noise"].items()
            for run in plan.spread("noise", ((signal, value),), drive, (1,), signed=False)
        ],
        "ramps": [
            run
            for signal, value in plan.RAMPS.items()
            for run in plan.spread("ramp", ((signal, value),), drive, (1,), plan.RAMP_LENGTH)
        ],
        "healthy": [
            *(Run(name, 1) for name in ("cut-in", "bumps", "hill", *HILLY[:6])),
            Run("braking", 1, peak=-8.0),
            *(Run(drive[0], 1, sensor=sensor) for sensor in plan.OTHER_SENSORS),
        ],
    }
    if recorded:
        groups["nearest in path"] = [Run(NEAREST, 0), *plan.nearest(plan.PAPER)[:2]]
        mishap = "a radar that loses its lead"
        groups[mishap] = [
            Run(name, 1, sensor=RECORDED_SENSORS, mishap=mishap) for name in TRAFFIC[:12]
        ]
    return groups


@dataclass(frozen=True)
class Requirements:
    """What was found; `ablation`: by mechanism and group, found and false or blamed."""

    findings: list[Finding]
    v2v: list[Finding]
    kinds: dict[str, dict[str, dict[str, int]]]
    ablation: dict[str, dict[str, dict[str, float]]]


def _ablated(extent: Extent, recorded: bool) -> dict[tuple[str, str], list[Run]]:
    """Runs by mechanism and group."""
    if not extent.ablation:
        return {}
    return {
        (name, title): [
            replace(run, changes=changes, lead="the truth" if "V2V" in name else "nothing")
            for run in runs
        ]
        for name, changes in MECHANISMS.items()
        for title, runs in ablation_runs(extent, recorded).items()
        # Nobody knows what the lead said in the recorded drive.
        if "V2V" not in name or runs[0].drive != NEAREST
    }


def count_runs(extent: Extent) -> int:
    """How many runs there are, the recorded drive's included."""
    chosen = [run for row in (*rows(extent, True), *v2v_rows(extent)) for run in row.runs]
    chosen += [run for runs in _ablated(extent, True).values() for run in runs]
    return len({run.key for run in chosen})


def measure(
    extent: Extent,
    recorded: Path | None,
    run_all: Callable[[list[Task]], dict[str, Any]],
    made: Callable[[Extent, bool], list[Row]] | None = None,
) -> Requirements:
    """Run and judge everything; `made`: other rows than all of them, and no more than those."""
    table = (made or rows)(extent, recorded is not None)
    v2v = [] if made else v2v_rows(extent)
    ablated = _ablated(extent, recorded is not None)
    everything = [run for row in (*table, *v2v) for run in row.runs]
    everything += [run for runs in ablated.values() for run in runs]
    unique = {run.key: run for run in everything}
    results = run_all(
        [Task(f"window/{key}", run_windows, (run, recorded)) for key, run in unique.items()]
    )

    def of(run: Run, profile: str) -> dict:
        return results[f"window/{run.key}"][profile]

    def judged(chosen: list[Row], profiles: tuple[str, ...]) -> list[Finding]:
        found = []
        for row in chosen:
            for profile in profiles:
                judge = Judge(row.title, profile, [of(run, profile) for run in row.runs])
                row.judge(judge)
                found += judge.findings
        return found

    return Requirements(
        judged(table, ("robust", "paper")),
        judged(v2v, ("robust",)),
        _kinds(table, of),
        _ablation(ablated, of),
    )


def _kinds(table: list[Row], of: Callable[[Run, str], dict]) -> dict:
    """Confusion of kinds by signal, from the rows of one signal."""
    by_signal: dict[str, dict[str, list[dict]]] = {}
    for row in table:
        kind, _, signal = row.title.partition(" ")
        if "rebuilt" in row.title or kind not in ("offset", *KINDS):
            continue
        signal = signal.split(" ")[0]
        windows = [w for run in row.runs for w in of(run, "robust")["windows"]]
        by_signal.setdefault(signal, {}).setdefault(kind, []).extend(windows)
    return {signal: kinds_confusion(by_kind) for signal, by_kind in by_signal.items()}


def _ablation(
    ablated: dict[tuple[str, str], list[Run]], of: Callable[[Run, str], dict]
) -> dict[str, dict[str, dict[str, float]]]:
    """By mechanism and group: share found, and flagged to the end, wrong blame, false events."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for (name, title), runs in ablated.items():
        results = [of(run, "robust") for run in runs]
        windows = [w for result in results for w in result["windows"]]
        made = [m for w in windows for m in w["signals"].values()]
        table.setdefault(name, {})[title] = {
            "found": sum(m["delay"] is not None for m in made) / len(made) if made else 1.0,
            "signals": len(made),
            "flagged": sum((m["fraction"] or 0.0) >= 0.97 for m in made) / len(made)
            if made
            else 1.0,
            "blamed": sum(bool(w["blamed"]) for w in windows),
            "stuck": sum(m["clear"] is None or m["clear"] > 1.5 for m in made),
            "false": sum(len(e) for r in results for e in r["false"].values()),
            "ready": min(min(r["ready"][s] for s in JUDGED) for r in results),
        }
    return table
