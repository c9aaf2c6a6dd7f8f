"""The whole evaluation: what is run, in which order, and what comes out of it."""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
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
    Comparison,
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
from lfd_replay.evaluation.recorded_tracks import TRACK_COUNT
from lfd_replay.evaluation.requirements.measure import Requirements, count_runs, measure
from lfd_replay.evaluation.requirements.plan import Extent, full_extent, plain_extent
from lfd_replay.evaluation.trace import load_trace
from lfd_replay.evaluation.variants import LINEAR, SINGLE, variants
from lfd_replay.generated.lead_profiles import NORMAL
from lfd_replay.journal import Journal, RunAll, Task, run_tasks
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
        # Starts and figures of 13 cases; traces of each normal drive, and what 5 detectors count.
        cases, drives = 13 * (self.starts + 1), 6 * len(self.normal)
        cells = sum(len(self.drives_of(cell)) for cell in (None, *self.cells))
        return cases + drives + cells + count_runs(self.extent) + TRACK_COUNT


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
    """Run everything that `work`, the folder of earlier results, does not hold yet.

    `done` is called after each task. Raises UserError where nothing can be written to `work`.
    """
    journal = Journal(work / "journal.jsonl", recorded)
    run = partial(run_tasks, journal=journal, pool=pool, done=done)
    campaign = _Campaign(size, settings, recorded, run)
    # The cases first: they are what most people look for.
    cases = campaign.cases()
    files = {
        name: {v: work / "normal" / f"{name} {v} {campaign.tag}.npz" for v in variants(settings)}
        for name in size.normal
    }
    hours = campaign.record(files, journal)
    traces = {
        variant: [load_trace(own[variant]) for own in files.values()]
        for variant in variants(settings)
    }
    scales = normal_scales(traces[PUBLISHED], list(size.normal), settings)
    normal = {variant: index_statistics(own) for variant, own in traces.items()}
    chosen = campaign.choose(scales, files, round(hours * FALSE_EVENTS_PER_HOUR))
    alike = Comparison(settings, scales, _by_detector(chosen))
    compared = campaign.compare(alike)
    return Evaluation(
        settings,
        size,
        cases,
        normal,
        chosen,
        [row for cell, own in compared if cell is not None for row in detector_rows(cell, own)],
        _confusion(compared),
        campaign.on_tracks(alike),
        measure(size.extent, recorded, run),
    )


class _Campaign:
    """The tasks of an evaluation; each part has results that the next one needs."""

    def __init__(
        self, size: Size, settings: GraphSettings, recorded: Path | None, run: RunAll
    ) -> None:
        """`run` runs tasks, as far as their results are not there yet."""
        self._size, self._settings, self._recorded, self._run = size, settings, recorded, run
        self.tag = _digest(settings.mpc.model_dump(), settings.bank.model_dump()) + _digest(
            settings.diagnosis.model_dump()
        )

    def cases(self) -> list[tuple[Case, dict, dict]]:
        """Each case with the figures of its first start, and over all starts."""
        starts = {
            case: phases(self._size.starts) if case.fault_texts(0.0) else [0.0]
            for case in table_3(self._recorded)
        }
        results = self._in_order(
            Task(
                f"case/{case.title}/{phase}/{self.tag}",
                score_case,
                (case, phase, self._settings, self._recorded),
            )
            for case, own in starts.items()
            for phase in own
        )
        summarised = []
        for case, own in starts.items():
            scored = [next(results) for _ in own]
            summarised.append((case, scored[0], summarise_phases(case, scored)))
        return summarised

    def record(self, files: dict[str, dict[str, Path]], journal: Journal) -> float:
        """Keep the traces of all normal drives; returns their hours.

        `files`: by drive and variant; a drive that lacks one of them is run again.
        """
        for name, own in files.items():
            if not all(file.is_file() for file in own.values()):
                journal.results.pop(f"normal/{name}/{self.tag}", None)
        return sum(
            self._in_order(
                Task(f"normal/{name}/{self.tag}", record_normal, (name, self._settings, own))
                for name, own in files.items()
            )
        )

    def choose(
        self, scales: NormalScales, files: dict[str, dict[str, Path]], allowed: int
    ) -> dict[str, dict[str, Choice]]:
        """Each detector's settings, from its false events on the normal drives in `files`."""
        found = detectors(self._settings, scales)
        learnt = _digest(scales.__dict__) + self.tag
        most = max(allowed, *EQUAL_EVENTS)
        results = self._in_order(
            Task(
                f"count/{detector.name}/{name}/{most}/{learnt}",
                count_normal,
                (number, own[detector.variant], self._settings, scales, most),
            )
            for number, detector in enumerate(found)
            for name, own in files.items()
        )
        counts = [[next(results) for _ in files] for _ in found]
        chosen = choose_settings(found, counts, allowed)
        for events in EQUAL_EVENTS:
            for name, choice in choose_settings(found, counts, events).items():
                if name not in (SINGLE, LINEAR):
                    chosen[at_equal(name, events)] = choice
        return chosen

    def compare(self, alike: Comparison) -> list[tuple[Cell | None, list[dict]]]:
        """What the detectors make of each cell, drive by drive; None: nothing is injected."""
        size, judged = self._size, self._judged(alike)
        cells: list[Cell | None] = [None, *size.cells]
        results = self._in_order(
            Task(
                f"cell/{cell.key if cell else 'nothing'}/{name}/{parts}/{judged}",
                compare_on,
                (cell, name, alike, parts),
            )
            for cell in cells
            for parts in [size.with_variants(cell)]
            for name in size.drives_of(cell)
        )
        return [(cell, [next(results) for _ in size.drives_of(cell)]) for cell in cells]

    def on_tracks(self, alike: Comparison) -> dict[str, Counter[str]]:
        """False events on the recorded radar's tracks, by detector and signal."""
        counted: dict[str, Counter[str]] = {}
        if self._recorded is None:
            return counted
        judged = self._judged(alike)
        for found in self._in_order(
            Task(
                f"track/{number}/{judged}",
                false_on_track,
                (number, self._recorded, alike),
            )
            for number in range(TRACK_COUNT)
        ):
            for label, events in found.items():
                counted.setdefault(label, Counter()).update(events)
        return counted

    def _judged(self, alike: Comparison) -> str:
        """Stands for all that a comparison depends on."""
        return _digest(alike.chosen, alike.scales.__dict__) + self.tag

    def _in_order(self, tasks: Iterable[Task]) -> Iterator[Any]:
        """The results of tasks, one after the other."""
        return iter(self._run(list(tasks)).values())


def _by_detector(
    chosen: dict[str, dict[str, Choice]],
) -> dict[str, dict[str, dict[str, float]]]:
    """The settings alone of what was chosen; a name begins with its detector's."""
    alone: dict[str, dict[str, dict[str, float]]] = {}
    for label, by_signal in chosen.items():
        values = {signal: choice.setting for signal, choice in by_signal.items()}
        alone.setdefault(label.partition(", ")[0], {})[label] = values
    return alone


def _confusion(
    compared: list[tuple[Cell | None, list[dict]]],
) -> dict[str, dict[str, dict[str, int]]]:
    """Fault injected against fault reported, of the paper's sizes and of drives without a fault."""
    return confusion(
        [
            (cell.injected if cell else (), result)
            for cell, own in compared
            if cell is None or _is_paper_size(cell)
            for result in own
        ]
    )


def _is_paper_size(cell: Cell) -> bool:
    """Whether a cell injects what the paper injects."""
    sizes = {signal: abs(value) for signal, value in PAPER}
    return cell.kind == "offset" and all(abs(v or 0.0) == sizes[s] for s, v in cell.values)


def _digest(*values: Any) -> str:
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:8]
