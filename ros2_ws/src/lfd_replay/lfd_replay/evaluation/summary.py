"""What the evaluation found, as `summary.json` and as the tables that people read."""

from dataclasses import asdict

from lfd_diagnosis.settings import TABLE_1
from lfd_diagnosis.verdict import SIGNALS
from lfd_replay.evaluation.campaign import Evaluation
from lfd_replay.evaluation.cases import RECORDED, SCAN_S, combination_title
from lfd_replay.evaluation.comparison import AS_PUBLISHED
from lfd_replay.evaluation.detectors import PUBLISHED, ROBUST, ROBUST_SET, is_at_equal
from lfd_replay.evaluation.normal_driving import IndexStatistics
from lfd_replay.evaluation.requirements.judge import Finding
from lfd_replay.evaluation.requirements.mechanisms import AS_IT_IS
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.profiles import PROFILES

Rows = list[tuple[str, ...]]


def summary(evaluation: Evaluation, complete: bool, elapsed: float) -> dict:
    """Everything as plain data; `elapsed` in s."""
    return {
        "profile": "paper",
        "full": complete,
        "elapsed_s": round(elapsed, 1),
        "cases": [
            {
                "drive": case.drive,
                "faults": case.fault_texts(0.0),
                "profile": "paper",
                "sensors": sensors,
                "over_starts": over_starts,
            }
            for case, sensors, over_starts in evaluation.cases
        ],
        "normal": _normal(evaluation.normal[PUBLISHED]),
        "variants": {name: _normal(found) for name, found in evaluation.normal.items()},
        "settings": {
            name: {signal: asdict(choice) for signal, choice in by_signal.items()}
            for name, by_signal in evaluation.chosen.items()
        },
        "detectors": evaluation.rows,
        "confusion": evaluation.confusion,
        "false_events_on_tracks": evaluation.on_tracks,
        "requirements": [f.as_dict() for f in evaluation.requirements.findings],
        "v2v": [f.as_dict() for f in evaluation.requirements.v2v],
        "kinds": evaluation.requirements.kinds,
        "mechanisms": evaluation.requirements.ablation,
    }


def _normal(found: IndexStatistics) -> dict:
    return {
        "hours": round(found.hours, 4),
        "zero_share": _finite(found.zero_share),
        "mean": _finite(found.mean),
        "std": _finite(found.std),
        "false_events_per_hour": _finite(found.false_events_per_hour),
    }


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    """JSON knows no NaN: where there is nothing to average there is no figure."""
    return {name: round(v, 6) if v == v else None for name, v in values.items()}


CASE_COLUMNS = ("drive", "fault", *SIGNALS, "wrongly blamed")


def case_rows(evaluation: Evaluation) -> Rows:
    """Table 3: per case and sensor, how often found over all starts, delay, share flagged."""
    rows: Rows = []
    for case, _, sensors in evaluation.cases:
        drive = "recorded" if case.drive == RECORDED else case.drive
        blamed = [
            f"{name} {figures['wrong_blame_s']:.1f} s"
            for name, figures in sensors.items()
            if figures["wrong_blame_s"] > 0.0 and name != "radar"
        ]
        rows.append(
            (
                drive,
                combination_title(case.combination),
                *(_verdict(sensors[name]) for name in SIGNALS),
                ", ".join(blamed) or "-",
            )
        )
    return rows


def _verdict(figures: dict) -> str:
    false = figures["false_events"]
    wrong = f"{false:.1f} false events" if false else ""
    if not figures["injected"]:
        return wrong or "-"
    if not figures["found"]:
        return f"missed, {wrong}" if wrong else "missed"
    low, high = f"{figures['delay_min_s'] * 1000:.0f}", f"{figures['delay_max_s'] * 1000:.0f}"
    parts = [
        f"{figures['found']} of {figures['starts']}",
        f"{low} ms" if low == high else f"{low}-{high} ms",
        f"{figures['flagged_fraction']:.0%}",
    ]
    return ", ".join([*parts, wrong] if wrong else parts)


NORMAL_COLUMNS = ("signal", "variant", "index zero", "mean", "std", "paper", "false events/h")


def normal_rows(evaluation: Evaluation) -> Rows:
    """Table 1, and what taking a part out changes."""
    rows: Rows = []
    for signal in JUDGED:
        for variant, found in evaluation.normal.items():
            mean, std = TABLE_1[signal]
            rows.append(
                (
                    signal,
                    variant,
                    f"{found.zero_share[signal]:.1%}",
                    *(
                        f"{figure:.3f}" if figure == figure else "-"
                        for figure in (found.mean[signal], found.std[signal])
                    ),
                    f"{mean:.3f} +- {std:.3f}" if variant == PUBLISHED else "",
                    f"{found.false_events_per_hour[signal]:.1f}",
                )
            )
    share = evaluation.normal[PUBLISHED].zero_share["all"]
    rows.append(("all three", PUBLISHED, f"{share:.1%}", "", "", "zero for about 94 %", ""))
    return rows


DETECTOR_COLUMNS = ("fault", "size", "detector", "windows", "found", "95 %", "delay", "95 %")


def detector_table_rows(evaluation: Evaluation) -> Rows:
    """Every cell of one signal, every detector."""
    rows: Rows = []
    for row in evaluation.rows:
        if len(row["injected"]) > 1 or is_at_equal(row["name"]):
            continue
        low, high = row["delay_low_s"], row["delay_high_s"]
        rows.append(
            (
                f"{row['kind']} {row['signal']}",
                "" if row["size"] is None else f"{row['size']:g}",
                row["name"],
                str(row["windows"]),
                f"{row['detected']:.1%}",
                f"{row['detected_low']:.0%}-{row['detected_high']:.0%}",
                _milliseconds(row["delay_s"]),
                "" if low is None else f"{low * 1000:.0f}-{high * 1000:.0f}",
            )
        )
    return rows


SETTING_COLUMNS = ("detector", *JUDGED)


def setting_rows(evaluation: Evaluation) -> Rows:
    """What each detector is set to, and the false events that it raises on the normal drives."""
    return [
        (
            name,
            *(f"{by_signal[s].setting:.3g} ({by_signal[s].false_events} false)" for s in JUDGED),
        )
        for name, by_signal in evaluation.chosen.items()
    ]


def track_rows(evaluation: Evaluation) -> Rows:
    """False events of each detector, set on generated drives, on the recorded radar's tracks."""
    return [
        (name, *(str(events[signal]) for signal in JUDGED))
        for name, events in evaluation.on_tracks.items()
    ]


def confusion_rows(evaluation: Evaluation) -> tuple[tuple[str, ...], Rows]:
    """Columns and rows of the profile's own confusion matrix."""
    matrix = evaluation.confusion[AS_PUBLISHED]
    return ("injected", *matrix), [
        (row, *(str(count) for count in counts.values())) for row, counts in matrix.items()
    ]


REQUIREMENT_COLUMNS = ("what", "figure", "target", "robust", "met", "paper", "met")


def requirement_rows(found: list[Finding]) -> Rows:
    """Every finding, both profiles side by side."""
    both: dict[tuple[str, str], dict[str, Finding]] = {}
    for finding in found:
        both.setdefault((finding.row, finding.what), {})[finding.profile] = finding
    rows: Rows = []
    for (row, what), by_profile in both.items():
        target = next(iter(by_profile.values())).target
        cells = [c for p in PROFILES for c in _told(by_profile.get(p))]
        rows.append((row, what, target, *cells))
    return rows


def _told(finding: Finding | None) -> tuple[str, str]:
    if finding is None:
        return "-", ""
    return finding.value, {True: "yes", False: "NO", None: ""}[finding.met]


V2V_COLUMNS = ("what", "figure", "robust")


def v2v_table(found: list[Finding]) -> Rows:
    """What the lead's word gains."""
    return [(finding.row, finding.what, finding.value) for finding in found]


KIND_COLUMNS = ("signal", "injected", "named")


def kind_rows(kinds: dict[str, dict[str, dict[str, int]]]) -> Rows:
    """Kind injected against kind named, in windows."""
    return [
        (signal, injected, ", ".join(f"{count} {name}" for name, count in named.items()))
        for signal, by_kind in kinds.items()
        for injected, named in by_kind.items()
    ]


MECHANISM_COLUMNS = (
    "switched off", "on", "found", "flagged 97 %", "blamed", "late clear", "false", "ready",
)  # fmt: skip


def mechanism_rows(ablation: dict[str, dict[str, dict[str, float | None]]]) -> Rows:
    """What each mechanism contributes: only where something differs from the profile as it is."""
    rows: Rows = []
    reference = ablation.get(AS_IT_IS, {})
    for name, groups in ablation.items():
        for title, figures in groups.items():
            if name != AS_IT_IS and figures == reference[title]:
                continue
            count = figures["signals"]
            rows.append(
                (
                    name,
                    title,
                    f"{figures['found']:.1%} of {count}" if count else "-",
                    f"{figures['flagged']:.1%}" if count else "-",
                    f"{figures['blamed']}",
                    f"{figures['stuck']}",
                    f"{figures['false']}",
                    f"{figures['ready']:.1%}",
                )
            )
    return rows


EQUAL_COLUMNS = (
    "fault",
    "size",
    "against",
    "found",
    "delay",
    *("robust found", "delay", "worse in"),
    *("robust, set alike", "delay", "worse in"),
)


def equal_rows(rows_of_cells: list[dict]) -> Rows:
    """The robust profile against each detector set to equal false events."""
    keyed: dict[tuple, dict[str, dict]] = {}
    for row in rows_of_cells:
        key = row["kind"], row["signal"], row["size"], tuple(row["injected"])
        keyed.setdefault(key, {})[row["name"]] = row
    table: Rows = []
    for (kind, signal, size, injected), by_name in keyed.items():
        own = [by_name[name] for name in (ROBUST, ROBUST_SET) if name in by_name]
        for name, row in by_name.items():
            if not own or not is_at_equal(name):
                continue
            with_others = f" of {len(injected)} faulty" if len(injected) > 1 else ""
            table.append(
                (
                    f"{kind} {signal}{with_others}",
                    "" if size is None else f"{size:g}",
                    name,
                    f"{row['detected']:.1%}",
                    _milliseconds(row["delay_s"]),
                    *(
                        text
                        for robust in own
                        for text in (
                            f"{robust['detected']:.1%}",
                            _milliseconds(robust["delay_s"]),
                            worse_in(robust, row),
                        )
                    ),
                )
            )
    return table


def worse_in(robust: dict, other: dict) -> str:
    """In what the robust profile is worse: rate beyond its interval, delay by over a scan."""
    worse = []
    if robust["detected_high"] < other["detected"]:
        worse.append("rate")
    both = robust["delay_s"] is not None and other["delay_s"] is not None
    if both and robust["delay_s"] > other["delay_s"] + SCAN_S:
        worse.append("delay")
    return ", ".join(worse)


def _milliseconds(delay: float | None) -> str:
    return "-" if delay is None else f"{delay * 1000:.0f} ms"


PAPER_TABLES = 6
"""Tables of the paper's evaluation, from the details to what comes first; those of the robust
profile follow."""


def tables(found: Evaluation) -> list[tuple[str, tuple[str, ...], Rows]]:
    """Title, columns and rows of every table, the most important one last."""
    requirements = found.requirements
    return [
        ("Every fault, every detector", DETECTOR_COLUMNS, detector_table_rows(found)),
        ("Settings with equal false events", SETTING_COLUMNS, setting_rows(found)),
        ("False events on the recorded radar's tracks", SETTING_COLUMNS, track_rows(found)),
        ("Injected against reported, paper profile", *confusion_rows(found)),
        ("Table 1: indices on normal drives", NORMAL_COLUMNS, normal_rows(found)),
        ("Table 3", CASE_COLUMNS, case_rows(found)),
        ("Robust against others, equal false events", EQUAL_COLUMNS, equal_rows(found.rows)),
        ("Kinds of fault, robust", KIND_COLUMNS, kind_rows(requirements.kinds)),
        ("The lead's word (V2V), robust", V2V_COLUMNS, v2v_table(requirements.v2v)),
        ("Mechanisms", MECHANISM_COLUMNS, mechanism_rows(requirements.ablation)),
        (
            "What must show, both profiles",
            REQUIREMENT_COLUMNS,
            requirement_rows(requirements.findings),
        ),
    ]
