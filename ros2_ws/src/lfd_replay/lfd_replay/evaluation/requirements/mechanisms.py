"""What each mechanism of the robust profile contributes: each is switched off, one by one."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from lfd_replay.evaluation.fault_windows import PAPER
from lfd_replay.evaluation.recorded_noise import RECORDED_SENSORS
from lfd_replay.evaluation.requirements import plan
from lfd_replay.evaluation.requirements.judge import TO_ITS_END, is_clear_soon
from lfd_replay.evaluation.requirements.plan import Extent
from lfd_replay.evaluation.requirements.rows import VALUES_OF_KIND
from lfd_replay.evaluation.requirements.windows import NEAREST, Run
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.generated.lead_profiles import HILLY, TRAFFIC


@dataclass(frozen=True)
class Ablation:
    """Settings of the robust profile that switch something off, and what the lead says."""

    changes: tuple[tuple[str, object], ...] = ()
    lead: str = "nothing"


AS_IT_IS = "as it is"

_NO_HOST_SPEED = ("use_host_speed", False)

MECHANISMS = {
    AS_IT_IS: Ablation(),
    "no learnt noise": Ablation((("learn_noise", False),)),
    "no check of roughness": Ablation((("check_roughness", False),)),
    "no check of repetition": Ablation((("check_repetition", False),)),
    "no check of drift": Ablation((("check_drift", False),)),
    "every new id a new car": Ablation((("same_car", False),)),
    "no host speed": Ablation((_NO_HOST_SPEED,)),
    "no observers (and no host speed)": Ablation((_NO_HOST_SPEED, ("use_observers", False))),
    "observers not restarted (and no host speed)": Ablation(
        (_NO_HOST_SPEED, ("restart_error", 0.0))
    ),
    "no bends of the road": Ablation((("steepest_road", 0.0),)),
    "no doubt of the speed": Ablation((("check_speed", False),)),
    "no latch": Ablation((("latch", False),)),
    "no V2V (and no host speed)": Ablation(
        (_NO_HOST_SPEED, ("use_lead_report", False)), lead="the truth"
    ),
    "V2V (and no host speed)": Ablation((_NO_HOST_SPEED,), lead="the truth"),
}
"""Each mechanism switched off."""

LONG = (("clearance", 2.0), ("relative_velocity", -4.0))
"""Offsets in m and m/s that a coasted track cannot tell for long."""


def _groups(extent: Extent, recorded: bool) -> dict[str, list[Run]]:
    """What the mechanisms are judged on, by title; small, since it is run for each of them."""
    drive = extent.few[1:2]
    groups = {
        "offsets of single signals": [
            run
            for signal, sizes in plan.OFFSETS.items()
            for run in plan.spread("offset", ((signal, sizes[0]),), drive, (1,))
        ],
        "Table 3": plan.spread("offset", PAPER, drive, (1,), 8.0, signed=False),
        "faults of 20 s": plan.spread("offset", LONG, drive, (1,), 20.0, signed=False),
        "clearance of a coarse sensor": plan.spread(
            "offset", (("clearance", 2.0),), drive, (1,), sensor="coarse"
        ),
        "held signals": [
            run for signal in JUDGED for run in plan.spread("hold", ((signal, None),), drive, (1,))
        ],
        "noise": [
            run
            for signal, value in VALUES_OF_KIND["noise"].items()
            for run in plan.spread("noise", ((signal, value),), drive, (1,), signed=False)
        ],
        "ramps": [
            run
            for signal, value in plan.RAMPS.items()
            for run in plan.spread("ramp", ((signal, value),), drive, (1,), plan.RAMP_LENGTH)
        ],
        "a host speed that slips": [
            run
            for signal, value in plan.SLIPS.items()
            for run in plan.spread("ramp", ((signal, value),), drive, (1,))
        ],
        "healthy": [
            *(Run(name, 1) for name in ("cut-in", "bumps", "hill", *HILLY[:6])),
            Run("braking", 1, peak=-8.0),
            *(Run(drive[0], 1, sensor=sensor) for sensor in plan.OTHER_SENSORS),
        ],
    }
    if recorded:
        groups["nearest in path"] = [Run(NEAREST, 0), *plan.nearest(PAPER)[:2]]
        mishap = "a radar that loses its lead"
        groups[mishap] = [
            Run(name, 1, sensor=RECORDED_SENSORS, mishap=mishap) for name in TRAFFIC[:12]
        ]
    return groups


def ablation_runs(extent: Extent, recorded: bool) -> dict[tuple[str, str], list[Run]]:
    """Runs of the robust profile by mechanism and group; none in an extent without ablation."""
    if not extent.ablation:
        return {}
    return {
        (name, title): [
            replace(run, changes=ablation.changes, lead=ablation.lead, profiles=("robust",))
            for run in runs
        ]
        for name, ablation in MECHANISMS.items()
        for title, runs in _groups(extent, recorded).items()
        # Nobody knows what the lead said in the recorded drive.
        if ablation.lead == "nothing" or runs[0].drive != NEAREST
    }


def ablation_table(
    ablated: dict[tuple[str, str], list[Run]], of: Callable[[Run, str], dict]
) -> dict[str, dict[str, dict[str, float | None]]]:
    """By mechanism and group: share found, and flagged to the end, wrong blame, false events.

    Of no window at all there is no share: None. `of`: what `run_windows` gave for a run and a
    profile.
    """
    table: dict[str, dict[str, dict[str, float | None]]] = {}
    for (name, title), runs in ablated.items():
        results = [of(run, "robust") for run in runs]
        windows = [w for result in results for w in result["windows"]]
        made = [m for w in windows for m in w["signals"].values()]
        table.setdefault(name, {})[title] = {
            "found": _share(m["delay"] is not None for m in made),
            "signals": len(made),
            "flagged": _share((m["fraction"] or 0.0) >= TO_ITS_END for m in made),
            "blamed": sum(bool(w["blamed"]) for w in windows),
            "stuck": sum(not is_clear_soon(m) for m in made),
            "false": sum(len(e) for r in results for e in r["false"].values()),
            "ready": min(min(r["ready"][s] for s in JUDGED) for r in results),
        }
    return table


def _share(marks: Iterable[bool]) -> float | None:
    marks = list(marks)
    return sum(marks) / len(marks) if marks else None
