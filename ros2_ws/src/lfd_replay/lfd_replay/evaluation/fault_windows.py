"""Which faults are injected where: cells of equal faults, spread over normal drives."""

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from lfd_replay.faults import Fault, parse_fault

WARM_UP, LENGTH, PAUSE = 8.0, 4.0, 5.0
"""Seconds before the first fault, of each fault, and at least between two of them."""


@dataclass(frozen=True)
class Cell:
    """One fault: its kind and its values by signal, in the unit of the kind; None = no value.

    `signed`: every other window has the opposite sign.
    """

    kind: str
    values: tuple[tuple[str, float | None], ...]
    signed: bool = False

    @property
    def injected(self) -> tuple[str, ...]:
        """The faulty signals."""
        return tuple(signal for signal, _ in self.values)

    @property
    def size(self) -> float | None:
        """The value of a fault of one signal."""
        return self.values[0][1] if len(self.values) == 1 else None

    @property
    def key(self) -> str:
        """A name of its own."""
        return f"{self.kind}:" + ",".join(
            s if v is None else f"{s}={'+-' if self.signed else ''}{v:g}" for s, v in self.values
        )

    def faults(self, drive: str, seed: int, duration: float) -> list[Fault]:
        """Faults over a drive of `duration` s, at times spread over the radar's scan phase."""
        generator = np.random.default_rng([seed, crc32(f"{drive}/{self.key}".encode())])
        faults = []
        start = WARM_UP + generator.uniform(0.0, 1.0)
        while start + LENGTH + PAUSE < duration:
            sign = -1.0 if self.signed and len(faults) % 2 else 1.0
            values = ",".join(s if v is None else f"{s}={sign * v:g}" for s, v in self.values)
            faults.append(parse_fault(f"{self.kind}:{values}@{start:.4f}-{start + LENGTH:.4f}"))
            start += LENGTH + PAUSE + generator.uniform(0.0, 1.0)
        return faults


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
