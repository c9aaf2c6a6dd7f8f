"""The whole evaluation: what is run, in which order, and what comes out of it."""

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lfd_replay.evaluation.cases import (
    Case,
    phases,
    score_case,
    summarise_phases,
    table_3,
)
from lfd_replay.evaluation.comparison import (
    NormalScales,
    choose_settings,
    compare_on,
    confusion,
    count_normal,
    detector_rows,
    detectors,
    false_on_track,
    normal_scales,
    record_normal,
)
from lfd_replay.evaluation.detectors import EQUAL_EVENTS, PUBLISHED, Choice, at_equal
from lfd_replay.evaluation.fault_windows import (
    PAPER,
    PAPER_COMBINATIONS,
    Cell,
    offset_cells,
    other_cells,
)
from lfd_replay.evaluation.normal_driving import IndexStatistics, index_statistics
from lfd_replay.evaluation.recorded_tracks import COUNT
from lfd_replay.evaluation.requirements.campaign import Requirements, count_runs, measure
from lfd_replay.evaluation.requirements.plan import Extent, full_extent, plain_extent
from lfd_replay.evaluation.trace import load_trace
from lfd_replay.evaluation.variants import LINEAR, SINGLE, variants
from lfd_replay.generated.lead_profiles import NORMAL
from lfd_replay.journal import Journal, Task, run_tasks
from lfd_replay.profiles import GraphSettings

FALSE_EVENTS_PER_HOUR = 1.0
"""False events per hour and signal that every detector may raise on the normal drives."""


@dataclass(frozen=True)
class Size:
    """How much is run; `parts`: whether variants of the graph are set against faults, too."""

    normal: tuple[str, ...]
    starts: int
    cells: tuple[Cell, ...]
    offset_drives: tuple[str, ...]
    other_drives: tuple[str, ...]
    parts: bool
    extent: Extent

    def drives_of(self, cell: Cell | None) -> tuple[str, ...]:
        """The normal drives that a cell's faults are injected into."""
        offset = cell is None or cell.kind == "offset"
        return self.offset_drives if offset else self.other_drives

    def with_variants(self, cell: Cell | None) -> bool:
        """What the parts are worth is asked of offsets, the faults that the paper is about."""
        return self.parts and (cell is None or cell.kind == "offset")

    @property
    def tasks(self) -> int:
        """Upper estimate of the number of tasks, for the progress bar."""
        cells = sum(len(self.drives_of(cell)) for cell in (None, *self.cells))
        return (
            13 * (self.starts + 1) + 6 * len(self.normal) + cells + count_runs(self.extent) + COUNT
        )


def plain() -> Size:
    """What ends within five minutes on two cores."""
    return Size(
        normal=NORMAL,
        starts=2,
        cells=(*offset_cells(full=False), *PAPER_COMBINATIONS, *other_cells(full=False)),
        offset_drives=NORMAL[6::14],
        other_drives=NORMAL[6::14],
        parts=False,
        extent=plain_extent(),
    )


def full() -> Size:
    """Everything; kinds other than offsets have no intervals as narrow."""
    return Size(
        normal=NORMAL,
        starts=10,
        cells=(*offset_cells(full=True), *PAPER_COMBINATIONS, *other_cells(full=True)),
        offset_drives=NORMAL,
        other_drives=NORMAL[::3],
        parts=True,
        extent=full_extent(),
    )


@dataclass(frozen=True)
class Evaluation:
    """Everything that was found; `cases` pairs each case with its figures over all starts.

    `on_tracks`: false events by detector and signal on every track of the recorded radar.
    """

    settings: GraphSettings
    size: Size
    cases: list[tuple[Case, dict, dict]]
    normal: dict[str, IndexStatistics]
    chosen: dict[str, dict[str, Choice]]
    rows: list[dict]
    confusion: dict[str, dict[str, dict[str, int]]]
    on_tracks: dict[str, Counter[str]]
    requirements: Requirements


def evaluate_paper(
    size: Size,
    settings: GraphSettings,
    recorded: Path | None,
    work: Path,
    pool: Executor,
    done: Callable[[], None],
) -> Evaluation:
    """Run everything that `work`, the folder of earlier results, does not hold yet."""
    journal = Journal(work / "journal.jsonl", recorded)
    tag = _digest(settings.mpc.model_dump(), settings.bank.model_dump()) + _digest(
        settings.diagnosis.model_dump()
    )

    def run(tasks: list[Task]) -> dict[str, Any]:
        return run_tasks(tasks, journal, pool, done)

    # The cases first: they are what most people look for.
    cases = table_3(recorded)
    scored = run(
        [
            Task(f"case/{c.title}/{p}/{tag}", score_case, (c, p, settings, recorded))
            for c in cases
            for p in (phases(size.starts) if c.fault_texts(0.0) else [0.0])
        ]
    )
    summarised = []
    for case in cases:
        own = [v for k, v in scored.items() if k.startswith(f"case/{case.title}/")]
        summarised.append((case, own[0], summarise_phases(case, own)))

    files = {
        name: {v: work / "normal" / f"{name} {v} {tag}.npz" for v in variants(settings)}
        for name in size.normal
    }
    for name, own in files.items():
        if not all(file.is_file() for file in own.values()):
            journal.results.pop(f"normal/{name}/{tag}", None)
    hours = run(
        [
            Task(f"normal/{name}/{tag}", record_normal, (name, settings, own))
            for name, own in files.items()
        ]
    )
    traces = {
        variant: [load_trace(own[variant]) for own in files.values()]
        for variant in variants(settings)
    }
    scales = normal_scales(traces[PUBLISHED], list(size.normal), settings)
    normal = {variant: index_statistics(own) for variant, own in traces.items()}

    allowed = round(sum(hours.values()) * FALSE_EVENTS_PER_HOUR)
    chosen = _choose(run, settings, scales, files, tag, allowed)
    plain_choice: dict[str, dict[str, dict[str, float]]] = {}
    for label, by_signal in chosen.items():
        values = {signal: choice.setting for signal, choice in by_signal.items()}
        plain_choice.setdefault(label.partition(", ")[0], {})[label] = values
    judged = _digest(plain_choice, scales.__dict__) + tag
    cells: list[Cell | None] = [None, *size.cells]
    compared = run(
        [
            Task(
                f"cell/{cell.key if cell else 'nothing'}/{name}/{parts}/{judged}",
                compare_on,
                (cell, name, 1, settings, scales, plain_choice, parts),
            )
            for cell in cells
            for parts in [size.with_variants(cell)]
            for name in size.drives_of(cell)
        ]
    )
    results = iter(compared.values())
    by_cell = [(cell, [next(results) for _ in size.drives_of(cell)]) for cell in cells]
    rows = [row for cell, own in by_cell if cell is not None for row in detector_rows(cell, own)]
    matrix = confusion(
        [
            (cell.injected if cell else (), result)
            for cell, own in by_cell
            if cell is None or _is_paper_size(cell)
            for result in own
        ]
    )
    on_tracks: dict[str, Counter[str]] = {}
    if recorded is not None:
        for found in run(
            [
                Task(
                    f"track/{number}/{judged}",
                    false_on_track,
                    (number, recorded, settings, scales, plain_choice),
                )
                for number in range(COUNT)
            ]
        ).values():
            for label, events in found.items():
                on_tracks.setdefault(label, Counter()).update(events)
    requirements = measure(size.extent, recorded, run)
    return Evaluation(
        settings, size, summarised, normal, chosen, rows, matrix, on_tracks, requirements
    )


def _choose(
    run: Callable[[list[Task]], dict[str, Any]],
    settings: GraphSettings,
    scales: NormalScales,
    files: dict[str, dict[str, Path]],
    tag: str,
    allowed: int,
) -> dict[str, dict[str, Choice]]:
    """Each detector's settings, from its false events on the normal drives."""
    found = detectors(settings, scales)
    learnt = _digest(scales.__dict__) + tag
    most = max(allowed, *EQUAL_EVENTS)
    counted = run(
        [
            Task(
                f"count/{detector.name}/{name}/{most}/{learnt}",
                count_normal,
                (number, own[detector.variant], settings, scales, most),
            )
            for number, detector in enumerate(found)
            for name, own in files.items()
        ]
    )
    results = list(counted.values())
    drives = len(files)
    counts = [results[k * drives : (k + 1) * drives] for k in range(len(found))]
    chosen = choose_settings(found, counts, allowed)
    for events in EQUAL_EVENTS:
        for name, choice in choose_settings(found, counts, events).items():
            if name not in (SINGLE, LINEAR):
                chosen[at_equal(name, events)] = choice
    return chosen


def _is_paper_size(cell: Cell) -> bool:
    """Whether a cell injects what the paper injects."""
    sizes = {signal: abs(value) for signal, value in PAPER}
    return cell.kind == "offset" and all(abs(v or 0.0) == sizes[s] for s, v in cell.values)


def _digest(*values: Any) -> str:
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
