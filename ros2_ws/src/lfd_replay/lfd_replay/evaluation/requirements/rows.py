"""The rows of the requirements: what is run for each line of the table, and how it is judged."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from lfd_diagnosis.verdict import Kind
from lfd_replay.evaluation.cases import RECORDED
from lfd_replay.evaluation.fault_windows import LENGTH, PAPER, Values
from lfd_replay.evaluation.mishaps import CHANGING_IDS, MISHAPS
from lfd_replay.evaluation.random_sensors import RANDOM_SENSORS
from lfd_replay.evaluation.recorded_noise import RECORDED_SENSORS, ROUGHER_SENSORS
from lfd_replay.evaluation.recorded_tracks import (
    BACKWARD,
    LANES,
    TRACK,
    TRACK_COUNT,
    TRACK_ID,
    TRACK_IDS,
)
from lfd_replay.evaluation.recorded_views import PHONES
from lfd_replay.evaluation.requirements import judge as judges
from lfd_replay.evaluation.requirements import plan
from lfd_replay.evaluation.requirements.judge import Judge
from lfd_replay.evaluation.requirements.plan import Extent
from lfd_replay.evaluation.requirements.windows import NEAREST, Run
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import MEASURED
from lfd_replay.generated.lead_profiles import HILLY, NEW_HILLY, NEW_TRAFFIC

VALUES_OF_KIND = {
    "hold": dict.fromkeys(MEASURED),
    "zero": dict.fromkeys(MEASURED),
    "dropout": dict.fromkeys(MEASURED),
    "ramp": {**plan.RAMPS, **plan.SLIPS},
    "gain": dict.fromkeys(JUDGED, 1.3),
    "noise": {"clearance": 0.56, "relative_velocity": 0.23, "acceleration": 0.8},
    "delay": dict.fromkeys(JUDGED, 0.5),
}
"""Other kinds of fault by signal, with their values; noise is ten times the sensor's own."""

JUDGES = {
    "hold": partial(judges.judge_held, kind=Kind.HOLD),
    "zero": partial(judges.judge_held, kind=Kind.ZERO),
    "dropout": judges.judge_dropout,
    "ramp": judges.judge_ramp,
}
"""How some of them are judged."""

JUDGE_BLIND = partial(judges.judge_healthy, ready=None)
"""Healthy drives without host speed: it takes a lead to be ready there."""

REBUILT = partial(judges.judge_rebuilt, recorded=False)
REBUILT_RECORDED = partial(judges.judge_rebuilt, recorded=True)
"""Reconstructed signals of generated and of recorded drives."""

OUTLIERS = (("clearance", 4.0), ("relative_velocity", 5.0), ("acceleration", 4.0))
"""Spikes in m, m/s and m/s^2: the first sample of every second."""

EXACT = "exact"
"""Sensors without noise: all seeds say the same."""

NEW = {"in new traffic": NEW_TRAFFIC, "among new hills": NEW_HILLY}
"""Drives that nothing was chosen on, by where they are."""


@dataclass(frozen=True)
class Row:
    """One line of the table: what is run and how it is judged.

    `counts_as`: the kind and the signal under which its windows count in the confusion of kinds.
    """

    title: str
    runs: Sequence[Run]
    judge: Callable[[Judge], None]
    counts_as: tuple[str, str] | None = None


def rows(extent: Extent, recorded: bool) -> list[Row]:
    """Everything but ablation and V2V, in the order in which it is printed."""
    made = [*_table_3(extent, recorded), *_offsets(extent)]
    if recorded:
        made += _real_leads(extent)
        made += _views_of_the_recorded_car(extent)
        made += _recorded_sensors(extent)
        made += _phones(extent)
        sensors = {"recorded sensors": RECORDED_SENSORS, "a phone": PHONES[0]}
        made += _on_new_roads(extent, sensors)
    made += _random_sensors(extent)
    made += _other_faults(extent)
    made += _healthy_drives(extent, recorded)
    made += _other_sensors(extent)
    if recorded:
        made += _recorded_radar()
    return made


def _table_3(extent: Extent, recorded: bool) -> Iterator[Row]:
    """Table 3's faults, on its drives and the recorded one."""
    for name, values in plan.TABLE_3.items():
        title = f"Table 3: {name}"
        runs = plan.table_3_runs(extent, values, recorded)
        yield Row(title, runs, judges.judge_table_3)
        generated = [run for run in runs if run.drive != RECORDED]
        yield Row(f"{title}, rebuilt", generated, REBUILT)
        if recorded:
            real = [run for run in runs if run.drive == RECORDED]
            yield Row(f"{title}, rebuilt, recorded", real, REBUILT_RECORDED)


def _offsets(extent: Extent) -> Iterator[Row]:
    """Offsets on normal drives, of one signal and of both of the radar's."""
    for signal, sizes in plan.OFFSETS.items():
        of_signal: list[Run] = []
        for size in sizes:
            runs = plan.spread("offset", ((signal, size),), extent.normal, extent.seeds)
            of_signal += runs
            title = f"offset {signal} +-{size:g}"
            yield Row(title, runs, judges.judge_offset, ("offset", signal))
        yield Row(f"offset {signal}, rebuilt", of_signal, REBUILT)
    title = "both radar signals for 8 s"
    long = plan.spread(
        "offset", PAPER[:2], extent.normal, extent.seeds, plan.LONG_LENGTH, signed=False
    )
    yield Row(title, long, judges.judge_long)
    yield Row(f"{title}, rebuilt", long, REBUILT)


def _real_leads(extent: Extent) -> Iterator[Row]:
    """Faults along the recorded drive and the longest tracks of its radar."""
    for name, values in plan.TABLE_3.items():
        runs = plan.real(extent, "offset", values, signed=False)
        yield Row(f"real leads: {name}", runs, judges.judge_long)
        yield Row(f"real leads: {name}, rebuilt", plan.as_driven(runs), REBUILT_RECORDED)
    for signal in plan.OFFSETS:
        runs = plan.real(extent, "offset", ((signal, 2.0),), signed=True)
        yield Row(f"real leads: {signal} +-2", runs, judges.judge_offset)
        yield Row(f"real leads: {signal} +-2, rebuilt", plan.as_driven(runs), REBUILT_RECORDED)
    for kind, judge in JUDGES.items():
        for signal, value in VALUES_OF_KIND[kind].items():
            length, signed = _length_of(kind, signal)
            runs = plan.real(extent, kind, ((signal, value),), signed, length)
            as_elsewhere = partial(judges.judge_kind, as_elsewhere=judge)
            yield Row(f"real leads: {kind} {signal}", runs, as_elsewhere)
            if kind == "ramp":
                runs = [replace(run, mishap=CHANGING_IDS) for run in runs]
                yield Row(f"real leads, ids change: {kind} {signal}", runs, as_elsewhere)


def _views_of_the_recorded_car(extent: Extent) -> Iterator[Row]:
    """The recorded car as if it had other sensors."""
    title = "other sensors of the recorded car"
    yield from _healthy(title, plan.views(extent))
    faults = partial(plan.faults_in_views, extent)
    yield from _combinations(title, faults, judges.judge_found_in_views)


def _recorded_sensors(extent: Extent) -> Iterator[Row]:
    """Generated drives with what the recorded sensors are off by."""
    title = "recorded sensors on generated leads"
    yield Row(f"{title}: healthy", plan.recorded_sensors_healthy(extent), judges.judge_healthy)
    yield from _recorded_sensors_in_traffic(extent)
    for name, values in plan.TABLE_3.items():
        runs = plan.recorded_sensors(extent, values, signed=False)
        yield Row(f"{title}: {name}", runs, judges.judge_long)
        yield Row(f"{title}: {name}, rebuilt", runs, REBUILT)
    for signal in plan.OFFSETS:
        runs = plan.recorded_sensors(extent, ((signal, 2.0),), signed=True)
        yield Row(f"{title}: {signal} +-2", runs, judges.judge_offset)
        yield Row(f"{title}: {signal} +-2, rebuilt", runs, REBUILT)
    yield from _among_hills("recorded sensors among hills", extent, RECORDED_SENSORS)


def _recorded_sensors_in_traffic(extent: Extent) -> Iterator[Row]:
    """Traffic, as the recorded sensors and rougher ones see it, and with what happens to them."""
    title, traffic = "recorded sensors in traffic", plan.in_traffic(extent, RECORDED_SENSORS)
    yield Row(f"{title}: healthy", traffic, judges.judge_healthy)
    runs = plan.faults_in_traffic(extent, "offset", PAPER[:2], False, sensor=RECORDED_SENSORS)
    yield Row(f"{title}: clearance and relative velocity", runs, judges.judge_in_traffic)
    rougher = plan.in_traffic(extent, ROUGHER_SENSORS)
    yield Row("rougher sensors in traffic: healthy", rougher, judges.judge_healthy)
    yield from _combinations_in_traffic("rougher sensors in traffic", extent, ROUGHER_SENSORS)
    for mishap in MISHAPS:
        runs = [replace(run, mishap=mishap) for run in traffic]
        yield Row(f"in traffic, {mishap}: healthy", runs, judges.judge_healthy)
    yield from _one_signal_in_traffic(title, extent, RECORDED_SENSORS)


def _phones(extent: Extent) -> Iterator[Row]:
    """What a phone feels in the accelerometer's place, in traffic and among hills."""
    title = "a phone in traffic"
    yield from _healthy(title, plan.phones_in_traffic(extent))
    runs = plan.faults_by_phones_in_traffic(extent, PAPER[2:])
    yield Row(f"{title}: acceleration", runs, judges.judge_in_traffic)
    # Joined to a table it would be the same road, felt less well.
    yield from _among_hills("a phone among hills", extent, PHONES[0])


def _random_sensors(extent: Extent) -> Iterator[Row]:
    """Sensors of random properties, in traffic, among hills and on new roads."""
    title = "random sensors in traffic"
    yield from _healthy(title, plan.in_traffic(extent, RANDOM_SENSORS))
    yield from _combinations_in_traffic(title, extent, RANDOM_SENSORS)
    yield from _one_signal_in_traffic(title, extent, RANDOM_SENSORS)
    yield from _among_hills("random sensors among hills", extent, RANDOM_SENSORS)
    yield from _on_new_roads(extent, {"random sensors": RANDOM_SENSORS})


def _other_faults(extent: Extent) -> Iterator[Row]:
    """What else may be wrong on normal drives: a held radar, no host speed, other kinds, spikes."""
    held = tuple((signal, None) for signal, _ in PAPER[:2])
    frozen = plan.spread("hold", held, extent.few, extent.seeds, signed=False)
    yield Row("the whole radar held", frozen, judges.judge_held_radar)
    title = "without host speed: acceleration +-4"
    blind = plan.spread("offset", PAPER[2:], extent.few, extent.seeds, host_speed=False)
    yield Row(title, blind, partial(judges.judge_found, delay=0.2))
    yield Row(f"{title}, rebuilt", blind, partial(REBUILT, host_speed=False))
    for kind, by_signal in VALUES_OF_KIND.items():
        judge = judges.judge_other
        if kind in JUDGES:
            judge = partial(judges.judge_kind, as_elsewhere=JUDGES[kind])
        for signal, value in by_signal.items():
            length, signed = _length_of(kind, signal)
            values = ((signal, value),)
            runs = plan.spread(kind, values, extent.few, extent.seeds[:1], length, signed)
            yield Row(f"{kind} {signal}", runs, judge, (kind, signal))
    for signal, value in OUTLIERS:
        runs = plan.spread("spike", ((signal, value),), extent.few, extent.seeds[:1])
        outliers = partial(_judge_outliers, signal=signal)
        yield Row(f"single outliers of {signal}", runs, outliers)


def _healthy_drives(extent: Extent, recorded: bool) -> Iterator[Row]:
    """Drives on which nothing is to be found."""
    yield Row("healthy drives", plan.healthy(extent, recorded), judges.judge_healthy)
    blind = plan.braking_blind(extent)
    yield Row("braking leads without host speed", blind, _judge_braking_blind)


def _other_sensors(extent: Extent) -> Iterator[Row]:
    """Normal drives as other generated sensors see them, and traffic as a simulator says it."""
    for sensor in plan.OTHER_SENSORS:
        title = f"sensor {sensor}"
        runs = plan.other_sensors_healthy(_once(extent) if sensor == EXACT else extent, sensor)
        yield Row(f"{title}: healthy", runs, judges.judge_healthy)
        faults = partial(plan.faults_of_other_sensors, extent, sensor)
        judge = partial(judges.judge_found, delay=0.3)
        yield from _combinations(title, faults, judge)
    yield from _healthy(f"sensor {EXACT} in traffic", plan.in_traffic(_once(extent), EXACT))


def _recorded_radar() -> Iterator[Row]:
    """Every target of the recorded radar, in and out of the car's path."""
    tracks = [Run(f"{TRACK}{number}", 0) for number in range(TRACK_COUNT)]
    yield Row("every track of the recorded radar", tracks, judges.judge_healthy)
    ids = [Run(f"{TRACK_ID}{number}", 0) for number in TRACK_IDS]
    yield Row("every id of the recorded radar", ids, partial(judges.judge_healthy, ready=0.8))
    lanes = [Run(f"{way}{lane}", 0) for lane in LANES for way in ("", BACKWARD)]
    yield Row("nearest in other lanes", lanes, partial(judges.judge_healthy, ready=0.5))
    title = "nearest in path"
    yield Row(title, [Run(NEAREST, 0)], partial(judges.judge_healthy, ready=0.8))
    judge = partial(judges.judge_found, delay=0.2)
    yield from _combinations(title, plan.nearest, judge)


def _healthy(title: str, runs: list[Run]) -> Iterator[Row]:
    """Healthy drives, with host speed and without."""
    yield Row(f"{title}: healthy", runs, judges.judge_healthy)
    blind = [replace(run, host_speed=False) for run in runs]
    yield Row(f"{title}, no host speed: healthy", blind, JUDGE_BLIND)


def _combinations(
    title: str, runs_of: Callable[[Values], list[Run]], judge: Callable[[Judge], None]
) -> Iterator[Row]:
    """Each of Table 3's faults."""
    for name, values in plan.TABLE_3.items():
        yield Row(f"{title}: {name}", runs_of(values), judge)


def _combinations_in_traffic(title: str, extent: Extent, sensor: str) -> Iterator[Row]:
    """Each of them in traffic as such sensors see it."""
    faults = partial(plan.faults_in_traffic, extent, "offset", signed=False, sensor=sensor)
    yield from _combinations(title, faults, judges.judge_in_traffic)


def _one_signal_in_traffic(title: str, extent: Extent, sensor: str) -> Iterator[Row]:
    """Faults of one signal in traffic as such sensors see it."""
    for signal in plan.OFFSETS:
        values = ((signal, 2.0),)
        runs = plan.faults_in_traffic(extent, "offset", values, True, sensor=sensor)
        yield Row(f"{title}: {signal} +-2", runs, judges.judge_in_traffic)
    for kind, judge in {**JUDGES, "dropout": judges.judge_blame}.items():
        in_traffic_too = partial(judges.judge_kind_in_traffic, as_elsewhere=judge)
        for signal, value in VALUES_OF_KIND[kind].items():
            length, signed = _length_of(kind, signal)
            values = ((signal, value),)
            runs = plan.faults_in_traffic(extent, kind, values, signed, length, sensor=sensor)
            yield Row(f"{title}: {kind} {signal}", runs, in_traffic_too)


def _among_hills(title: str, extent: Extent, sensor: str) -> Iterator[Row]:
    """Traffic among hills as such sensors see it."""
    yield from _healthy(title, plan.in_traffic(extent, sensor, HILLY))
    for size in (2.0, 4.0):
        values = (("acceleration", size),)
        runs = plan.faults_in_traffic(extent, "offset", values, True, sensor=sensor, drives=HILLY)
        yield Row(f"{title}: acceleration +-{size:g}", runs, judges.judge_in_traffic)


def _on_new_roads(extent: Extent, sensors: dict[str, str]) -> Iterator[Row]:
    """Healthy drives on roads that were not looked at while mending, as each sensor sees them."""
    for name, sensor in sensors.items():
        for where, drives in NEW.items():
            runs = plan.in_traffic(_once(extent), sensor, drives)
            yield Row(f"{name} {where}: healthy", runs, judges.judge_healthy)


def _once(extent: Extent) -> Extent:
    """With one seed of each healthy drive."""
    return replace(extent, seeds=extent.seeds[:1], healthy_seeds=extent.healthy_seeds[:1])


def _length_of(kind: str, signal: str) -> tuple[float, bool]:
    """Seconds of such a fault, and whether it goes either way."""
    drifts = kind == "ramp" and signal in plan.RAMPS
    return plan.RAMP_LENGTH if drifts else LENGTH, kind == "ramp"


def _judge_outliers(judge: Judge, signal: str) -> None:
    """Outliers of one sample are no faults."""
    flagged = [m["delay"] is not None for m in judge.of(signal)]
    judge.share("not taken for a fault", [not flag for flag in flagged], 0.99)
    judge.no_blame()


def _judge_braking_blind(judge: Judge) -> None:
    """One false event per braking at the most."""
    judge.no_false_events(1.0)


V2V_SIZES = (1.5, 2.0, 4.0)
"""Offsets of the acceleration in m/s^2 that are looked for without host speed."""


def v2v_rows(extent: Extent) -> list[Row]:
    """What the lead's word gains, and that a lie makes nothing worse."""
    made = []
    few, seeds = extent.few, extent.seeds[:1]
    for lead in ("nothing", "the truth", "a lie"):
        title, more = f"V2V says {lead}", {"lead": lead, "profiles": ("robust",)}
        for size in V2V_SIZES:
            values = (("acceleration", size),)
            runs = plan.spread("offset", values, few, seeds, host_speed=False, **more)
            title_of_size = f"{title}: acceleration +-{size:g} without host speed"
            made.append(Row(title_of_size, runs, _judge_v2v_offset))
        runs = plan.spread("offset", PAPER[:2], few, seeds, **more)
        made.append(Row(f"{title}: clearance and relative velocity", runs, _judge_v2v_rebuilt))
        drives = [
            Run(name, seed, host_speed=False, **more)
            for name in few
            for seed in extent.healthy_seeds
        ]
        made.append(Row(f"{title}: healthy", drives, _judge_v2v_healthy))
    return made


def _judge_v2v_offset(judge: Judge) -> None:
    found = [m["delay"] is not None for m in judge.of("acceleration")]
    judge.share("found", found, 0.99, needed=False)
    judge.no_false_events()


def _judge_v2v_rebuilt(judge: Judge) -> None:
    """How far off the coasted signals are, over all that was valid."""
    for signal in ("clearance", "relative_velocity"):
        rebuilt = [w["rebuilt"][signal] for w in judge.windows]
        rms, total = judges.rms_over_all(rebuilt)
        judge.add(f"{signal} rebuilt over 4 s, rms", f"{rms:.2f}")
        flagged = sum(r["flagged"] for r in rebuilt)
        judge.add(f"{signal} valid meanwhile", f"{total / max(flagged, 1):.1%} of {flagged} steps")
    judge.no_false_events()


def _judge_v2v_healthy(judge: Judge) -> None:
    judge.no_false_events()
