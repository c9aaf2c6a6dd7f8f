"""The closed loop without ROS: world, controller, bank, diagnosis and decision in turn."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan

from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.fault_level import DecisionMaker
from lfd_diagnosis.verdict import Report
from lfd_mpc.decision import Action, Decision, FaultLevel
from lfd_mpc.driving import DrivingMpc, DrivingState
from lfd_mpc.horizon import Horizon
from lfd_observer.bank import ObserverBank
from lfd_replay.profiles import GraphSettings
from lfd_vehicle.sensing import Moment
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.world import Scenario, World


@dataclass(frozen=True)
class LoopStep:
    """One step of 10 ms: what really was, and what every node said to it."""

    moment: Moment
    driving: DrivingState
    report: Report | None
    decision: Decision | None


class ClosedLoop:
    """Steps the world; with or without the diagnosis in the loop."""

    def __init__(
        self,
        scenario: Scenario,
        graph: GraphSettings,
        vehicle: VehicleSettings,
        heeded: bool = True,
        diagnosed: bool = True,
    ) -> None:
        """`heeded`: whether the controller acts on the decisions; `diagnosed`: whether there are
        any. Raises UserError.
        """
        control = graph.mpc.model_copy(update={"driving": True})
        self.world = World(scenario, vehicle, control)
        self._mpc = DrivingMpc(control)
        self._bank = ObserverBank(graph.bank)
        self._diagnosis = make_diagnosis(graph.diagnosis)
        self._maker = DecisionMaker(graph.decision) if diagnosed else None
        self._heeded = heeded

    def run(self) -> Iterator[LoopStep]:
        """All steps until the scenario ends. Raises DivergenceError."""
        world, mpc = self.world, self._mpc
        while not world.ended:
            for sample in world.sense():
                horizons = mpc.push(sample)
                for horizon, driving in zip(horizons, mpc.driven, strict=False):
                    world.vehicle.command(horizon.command)
                    report, decision = self._judge(horizon)
                    yield LoopStep(world.moment, driving, report, decision)
            world.step()

    def _judge(self, horizon: Horizon) -> tuple[Report | None, Decision | None]:
        if self._maker is None:
            self._mpc.driver.decide(_nothing_wrong(horizon))
            return None, None
        outcome = self._diagnosis.step(horizon, self._bank.step(horizon))
        decision = self._maker.step(outcome.report, outcome.reconstruction)
        self._mpc.driver.decide(decision if self._heeded else _nothing_wrong(horizon))
        return outcome.report, decision


def _nothing_wrong(horizon: Horizon) -> Decision:
    """What a car that heeds no diagnosis is driven by: every sensor as it is."""
    usable, unknown = (True,) * 4, (nan,) * 4
    level, action = FaultLevel.NORMAL, Action.FOLLOW
    return Decision(horizon.stamp, horizon.step, level, action, 0, "", 0.0, *usable, *unknown)
