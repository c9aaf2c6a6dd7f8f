"""One step of the graph as it was said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lfd_diagnosis.verdict import Reconstruction, Report
from lfd_mpc.horizon import Horizon
from lfd_observer.bank import BankState

if TYPE_CHECKING:
    from lfd_replay.offline import GraphStep


@dataclass(frozen=True)
class RecordedStep:
    """What every node said about one step; None is an answer that was lost."""

    horizon: Horizon
    bank: BankState | None
    report: Report
    reconstruction: Reconstruction | None

    @classmethod
    def offline(cls, step: GraphStep) -> RecordedStep:
        """The same of a step without a graph."""
        said = step.outcome
        return cls(step.horizon, step.bank, said.report, said.reconstruction)
