"""One step of the graph as it was said."""

from dataclasses import dataclass

from lfd_diagnosis.verdict import Report
from lfd_mpc.horizon import Horizon
from lfd_observer.bank import BankState


@dataclass(frozen=True)
class RecordedStep:
    """What every node said about one step; `bank` is None where its answer was lost."""

    horizon: Horizon
    bank: BankState | None
    report: Report
