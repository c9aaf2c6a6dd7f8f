"""What the robust profile makes of some things that happen, faults and others, as one figure."""

from dataclasses import dataclass, replace

from lfd_replay.drawing.figures import Figure, Panel
from lfd_replay.drawing.panels import Recording, sensor_panel
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.recorded_step import RecordedStep


@dataclass(frozen=True)
class Example:
    """What is seen of one signal of a generated drive from `start` to `end`, in s of drive time."""

    title: str
    drive: str
    signal: str
    start: float
    end: float
    faults: tuple[str, ...] = ()
    peak: float | None = None


EXAMPLES = (
    Example(
        "both radar signals off at once",
        "data-1",
        "clearance",
        17.0,
        33.0,
        ("offset:clearance=4,relative_velocity=-10@20-30",),
    ),
    Example(
        "the clearance off alone",
        "data-1",
        "clearance",
        17.0,
        33.0,
        ("offset:clearance=4@20-30",),
    ),
    Example(
        "a clearance that drifts by 0.5 m/s",
        "data-1",
        "clearance",
        37.0,
        53.0,
        ("ramp:clearance=0.5@40-50",),
    ),
    Example(
        "a relative velocity that says the same",
        "data-1",
        "relative_velocity",
        37.0,
        53.0,
        ("hold:relative_velocity@40-50",),
    ),
    Example(
        "an accelerometer off by 2 m/s²",
        "data-1",
        "acceleration",
        47.0,
        63.0,
        ("offset:acceleration=2@50-60",),
    ),
    Example("no fault: the road climbs", "hill", "acceleration", 10.0, 50.0),
    Example("no fault: another car cuts in", "cut-in", "clearance", 15.0, 35.0),
    Example(
        "no fault: the lead brakes by 8 m/s²", "braking", "relative_velocity", 15.0, 35.0, peak=-8.0
    ),
)


def examples_figure() -> Figure:
    """The figure; it takes some seconds."""
    says = (
        "Some faults, and things that are none, as the robust profile sees them: what was "
        "measured, red while it is called faulty, and beneath it what it should be by everything "
        "but itself, with the ground that 95 % of it should lie in, for as long as that is valid."
    )
    panels = [example_panel(example) for example in EXAMPLES]
    return Figure("robust-examples", "The robust profile at work", says, panels, columns=2)


def example_panel(example: Example) -> Panel:
    """One example; it takes a second or two."""
    drive = generate_drive(example.drive, 0, "esr", example.peak)
    faults = parse_faults(list(example.faults))
    end = drive.zero + round(example.end * 1e9)
    samples = [sample for sample in drive.samples if sample.stamp <= end]
    graph = OfflineGraph(graph_settings("robust"))
    steps = [
        RecordedStep.offline(step)
        for step in graph.run(FaultInjector(faults, drive.zero, 0).apply(samples))
        if (step.horizon.stamp - drive.zero) * 1e-9 >= example.start
    ]
    panel = sensor_panel(Recording(steps, drive.zero, faults), example.signal)
    return replace(panel, title=example.title, height=0.7)
