"""The page to watch a closed-loop run: both cars and what is known of them, from the bag."""

import html
import json
from importlib.resources import files
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from lfd_diagnosis.verdict import State
from lfd_mpc.decision import Action, FaultLevel
from lfd_mpc.driving import Source
from lfd_mpc.errors import UserError
from lfd_mpc.settings import STEP_S
from lfd_replay.drive_bag import open_bag
from lfd_replay.faults import MEASURED, Fault
from lfd_replay.text_file import write_text

STRIDE = 5
"""Steps between two moments of the page: 20 a second."""

ROUNDING = 1e-6
"""Seconds that equal stamps may differ by once they are floats."""

TOPICS = (
    "vehicle/truth",
    "mpc/driving",
    "diagnosis/faults",
    "diagnosis/decision",
    "mpc/horizon",
)
"""What the page is made of: without a message on each of these there is none."""

TRUTH = (
    "clearance",
    "relative_velocity",
    "host_speed",
    "host_acceleration",
    "host_pitch",
    "lead_speed",
)


def write_watch_page(bag: Path, page: Path, faults: list[Fault]) -> Path:
    """Write the page of a recorded run and return its path.

    Raises UserError where the bag has no closed loop, or the page cannot be written.
    """
    run = _read(bag)
    run["faults"] = [
        {"text": fault.text, "start": fault.start * 1e-9, "end": fault.end * 1e-9}
        for fault in faults
    ]
    template = files("lfd_vehicle").joinpath("watch_page.html").read_text()
    # A closing tag inside of text would end the script that holds it.
    data = json.dumps(run, allow_nan=False, separators=(",", ":")).replace("</", "<\\/")
    title = html.escape(f"closed loop: {bag}")
    write_text(page, template.replace("{{title}}", title).replace("{{run}}", data))
    return page


def _read(bag: Path) -> dict[str, Any]:
    """What the page draws, by name, as lists of equal length. Raises UserError as its caller."""
    topics = _messages(bag)
    truth = topics["vehicle/truth"][::STRIDE]
    time = np.array([_seconds(m) for m in truth])
    return {
        "time": _rounded(time),
        "states": [state.name for state in State],
        "levels": [level.name for level in FaultLevel],
        "actions": [action.name for action in Action],
        "sources": [source.name for source in Source],
        "collided": [bool(m.collided) for m in truth],
        "model": [m.model for m in truth],
        **{name: _rounded([getattr(m, name) for m in truth]) for name in TRUTH},
        **_driven_by(_at(time, topics["mpc/driving"])),
        **_measured(_at(time, topics["mpc/horizon"])),
        **_decided(time, topics["diagnosis/decision"]),
        **_judged(_at(time, topics["diagnosis/faults"])),
    }


def _messages(bag: Path) -> dict[str, list[Any]]:
    """All messages of `TOPICS`, by topic."""
    found: dict[str, list[Any]] = {f"/{topic}": [] for topic in TOPICS}
    with open_bag(bag) as reader:
        chosen = [c for c in reader.connections if c.topic in found]
        for connection, _, raw in reader.messages(chosen):
            found[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    if not all(found.values()):
        missing = ", ".join(name for name, messages in found.items() if not messages)
        raise UserError(f"{bag}: no closed loop was recorded: nothing on {missing}")
    return {name.removeprefix("/"): messages for name, messages in found.items()}


def _driven_by(driving: list[Any]) -> dict[str, Any]:
    """What the car was driven by."""
    run: dict[str, Any] = {
        "command": _rounded([m.command for m in driving]),
        "desired": _rounded([m.desired_clearance for m in driving]),
    }
    for name in ("clearance", "relative_velocity"):
        run[f"used_{name}"] = _rounded([getattr(m, name) for m in driving])
        run[f"{name}_source"] = [int(getattr(m, f"{name}_source")) for m in driving]
    run["holding"] = [bool(m.holding) for m in driving]
    run["driving_reason"] = _numbered([m.reason for m in driving])
    return run


def _measured(horizons: list[Any]) -> dict[str, Any]:
    """What the sensors said."""
    run = {}
    for name in MEASURED:
        # What was measured last stays in the message; a silent sensor measures nothing.
        fresh = [nan if getattr(h, f"{name}_stale") else 1.0 for h in horizons]
        measured = [getattr(h, f"measured_{name}") for h in horizons]
        run[f"measured_{name}"] = _rounded(np.multiply(measured, fresh))
    return run


def _decided(time: np.ndarray, decisions: list[Any]) -> dict[str, Any]:
    """What was to be done; None before the first decision.

    The car is driven by the decision of the step before.
    """
    before = time - STEP_S
    first = int(np.searchsorted(before, _seconds(decisions[0]) - ROUNDING))
    decided = _at(before, decisions)[first:]
    return {
        "level": [None] * first + [int(m.level) for m in decided],
        "action": [None] * first + [int(m.action) for m in decided],
    }


def _judged(reports: list[Any]) -> dict[str, Any]:
    """What the diagnosis said of each signal."""
    run: dict[str, Any] = {}
    for name in MEASURED:
        verdicts = [getattr(m, name) for m in reports]
        run[f"state_{name}"] = [int(v.state) for v in verdicts]
        run[f"reason_{name}"] = _numbered([v.reason for v in verdicts])
    return run


def _seconds(message: Any) -> float:
    stamp = message.header.stamp
    return stamp.sec + stamp.nanosec * 1e-9


def _at(time: np.ndarray, messages: list[Any]) -> list[Any]:
    """The newest message at each time; the first one before there was any."""
    stamps = np.array([_seconds(m) for m in messages])
    found = np.searchsorted(stamps, time + ROUNDING, side="right") - 1
    return [messages[i] for i in found.clip(min=0)]


def _rounded(values: Any) -> list[float | None]:
    """Numbers as JSON: three digits, and null where there is none."""
    return [round(float(v), 3) if np.isfinite(v) else None for v in values]


def _numbered(texts: list[str]) -> dict[str, Any]:
    """Texts that repeat: each one once, and which one holds when."""
    known = {text: number for number, text in enumerate(dict.fromkeys(texts))}
    return {"texts": list(known), "at": [known[text] for text in texts]}
