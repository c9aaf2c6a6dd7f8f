"""Which faults are injected where: cells of equal faults, spread over normal drives."""

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from lfd_replay.faults import Fault, parse_faults

WARM_UP, LENGTH, PAUSE = 8.0, 4.0, 5.0
"""Seconds before the first fault, of each fault, and at least between two of them."""

Values = tuple[tuple[str, float | None], ...]
"""Faulty signals with their values in the unit of the kind; None where it has none."""


def fault_starts(key: str, seed: int, duration: float, length: float = LENGTH) -> list[float]:
    """Starts in s of faults of `length` s over a drive of `duration` s, one after the other.

    They are spread over the radar's scan phase, the same for the same key and seed.
    """
    generator = np.random.default_rng([seed, crc32(key.encode())])
    starts = []
    start = WARM_UP + generator.uniform(0.0, 1.0)
    while start + length + PAUSE < duration:
        starts.append(start)
        start += length + PAUSE + generator.uniform(0.0, 1.0)
    return starts


def fault_texts(
    kind: str, values: Values, signed: bool, starts: Sequence[float], length: float = LENGTH
) -> list[str]:
    """Faults as the command line takes them; `signed`: every other one has the opposite sign."""
    texts = []
    for number, start in enumerate(starts):
        sign = -1.0 if signed and number % 2 else 1.0
        given = ",".join(s if v is None else f"{s}={sign * v:g}" for s, v in values)
        texts.append(f"{kind}:{given}@{start:.4f}-{start + length:.4f}")
    return texts


@dataclass(frozen=True)
class Cell:
    """One fault: its kind and its values by signal.

    `signed`: every other window has the opposite sign.
    """

    kind: str
    values: Values
    signed: bool = False

    @property
    def injected(self) -> tuple[str, ...]:
        """The faulty signals."""
        return tuple(signal for signal, _ in self.values)

    @property
    def key(self) -> str:
        """A name of its own."""
        return f"{self.kind}:" + ",".join(
            s if v is None else f"{s}={'+-' if self.signed else ''}{v:g}" for s, v in self.values
        )

    def faults(self, drive: str, seed: int, duration: float) -> list[Fault]:
        """Faults over a drive of `duration` s, at times spread over the radar's scan phase."""
        starts = fault_starts(f"{drive}/{self.key}", seed, duration)
        return parse_faults(fault_texts(self.kind, self.values, self.signed, starts))


PAPER = (("clearance", 4.0), ("relative_velocity", -10.0), ("acceleration", 4.0))
"""The sizes of the paper (section 5)."""

PAPER_COMBINATIONS = (Cell("offset", PAPER[:2]), Cell("offset", PAPER))
"""Faults of several signals at once (Table 3)."""

SIZES = {
    "clearance": (0.25, 0.5, 1.0, 2.0, 4.0),
    "relative_velocity": (0.25, 0.5, 1.0, 2.0, 5.0, 10.0),
    "acceleration": (0.25, 0.5, 1.0, 2.0, 4.0),
}
"""Offsets in m, m/s and m/s^2."""

OTHER_KINDS = {
    "ramp": (0.5, 0.5, 0.5),
    "gain": (1.2, 1.2, 1.2),
    "noise": (1.0, 1.0, 1.0),
    "delay": (0.5, 0.5, 0.5),
    "spike": (4.0, 10.0, 4.0),
    "hold": (None, None, None),
    "zero": (None, None, None),
    "dropout": (None, None, None),
}
"""Values of the other kinds for clearance, relative velocity and acceleration."""


def offset_cells(full: bool) -> list[Cell]:
    """Offsets of one signal; fewer sizes where the run is not the full one."""
    return [
        Cell("offset", ((signal, size),), signed=True)
        for signal, sizes in SIZES.items()
        for size in (sizes if full else sizes[-3:])
    ]


def other_cells(full: bool) -> list[Cell]:
    """The other kinds of one signal."""
    kinds = OTHER_KINDS if full else {kind: OTHER_KINDS[kind] for kind in ("ramp", "hold", "zero")}
    return [
        Cell(kind, ((signal, value),), signed=kind in ("ramp", "spike"))
        for kind, values in kinds.items()
        for signal, value in zip(SIZES, values, strict=True)
    ]
