"""All requirements: runs them, judges both profiles, and says what each mechanism contributes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lfd_replay.evaluation.requirements.judge import Finding, Judge, kinds_confusion
from lfd_replay.evaluation.requirements.mechanisms import ablation_runs, ablation_table
from lfd_replay.evaluation.requirements.plan import Extent
from lfd_replay.evaluation.requirements.rows import Row, rows, v2v_rows
from lfd_replay.evaluation.requirements.windows import Run, run_windows
from lfd_replay.journal import RunAll, Task


@dataclass(frozen=True)
class Requirements:
    """What was found; `ablation`: by mechanism and group, found and false or blamed.

    `kinds`: by signal, kind injected and kind named, in windows.
    """

    findings: list[Finding]
    v2v: list[Finding]
    kinds: dict[str, dict[str, dict[str, int]]]
    ablation: dict[str, dict[str, dict[str, float | None]]]


def count_runs(extent: Extent) -> int:
    """How many runs there are, the recorded drive's included."""
    chosen = [run for row in (*rows(extent, True), *v2v_rows(extent)) for run in row.runs]
    chosen += [run for runs in ablation_runs(extent, True).values() for run in runs]
    return len({run.key for run in chosen})


def measure(
    extent: Extent,
    recorded: Path | None,
    run_all: RunAll,
    only: list[Row] | None = None,
) -> Requirements:
    """Run and judge everything, or `only` some rows."""
    table = rows(extent, recorded is not None) if only is None else only
    v2v = v2v_rows(extent) if only is None else []
    ablated = ablation_runs(extent, recorded is not None)
    everything = [run for row in (*table, *v2v) for run in row.runs]
    everything += [run for runs in ablated.values() for run in runs]
    unique = {run.key: run for run in everything}
    results = run_all(
        [Task(f"window/{key}", run_windows, (run, recorded)) for key, run in unique.items()]
    )

    def of(run: Run, profile: str) -> dict:
        return results[f"window/{run.key}"][profile]

    def judged(chosen: list[Row]) -> list[Finding]:
        found = []
        for row in chosen:
            for profile in row.runs[0].profiles:
                judge = Judge(row.title, profile, [of(run, profile) for run in row.runs])
                row.judge(judge)
                found += judge.findings
        return found

    return Requirements(judged(table), judged(v2v), _kinds(table, of), ablation_table(ablated, of))


def _kinds(table: list[Row], of: Callable[[Run, str], dict]) -> dict:
    """Confusion of kinds by signal, from the rows that count for it."""
    by_signal: dict[str, dict[str, list[dict]]] = {}
    for row in table:
        if row.counts_as is not None:
            kind, signal = row.counts_as
            windows = [w for run in row.runs for w in of(run, "robust")["windows"]]
            by_signal.setdefault(signal, {}).setdefault(kind, []).extend(windows)
    return {signal: kinds_confusion(by_kind) for signal, by_kind in by_signal.items()}
