"""The whole graph without ROS: the same cores, called one after the other."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.verdict import Outcome
from lfd_mpc.errors import UserError
from lfd_mpc.horizon import Horizon, Mpc
from lfd_mpc.sampling import Sample
from lfd_observer.bank import BankState, ObserverBank
from lfd_replay.profiles import GraphSettings


@dataclass(frozen=True)
class GraphStep:
    """What every node says about one step."""

    horizon: Horizon
    bank: BankState
    outcome: Outcome


class OfflineGraph:
    """Controller, bank and diagnosis in one object."""

    def __init__(self, settings: GraphSettings) -> None:
        """Raises UserError for settings that cannot work."""
        try:
            self._mpc = Mpc(settings.mpc)
        except ValueError as error:
            raise UserError(f"mpc_node: {error}") from error
        self._bank = ObserverBank(settings.bank)
        self._diagnosis = make_diagnosis(settings.diagnosis)

    def push(self, sample: Sample) -> Iterator[GraphStep]:
        """Take one sample; gives the steps that it releases."""
        for horizon in self._mpc.push(sample):
            yield self.answer(horizon)

    def answer(self, horizon: Horizon) -> GraphStep:
        """What bank and diagnosis say to a horizon."""
        bank = self._bank.step(horizon)
        return GraphStep(horizon, bank, self._diagnosis.step(horizon, bank))

    def run(self, samples: Iterable[Sample]) -> Iterator[GraphStep]:
        """All steps of a drive."""
        for sample in samples:
            yield from self.push(sample)
