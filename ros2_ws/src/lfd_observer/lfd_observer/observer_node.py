"""observer_node: prediction horizons in, the observer bank's limits out."""

import time

from rclpy.context import Context
from rclpy.node import Node

from lfd_mpc.health import Health, StepHealth
from lfd_mpc.horizon import Horizon, check_horizon, first_horizon
from lfd_mpc.messages import from_message, to_message
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    HealthPublisher,
    ReadyAnnouncer,
    declare_settings,
)
from lfd_msgs.msg import ObserverBank as ObserverBankMessage
from lfd_msgs.msg import PredictionHorizon
from lfd_observer.bank import ObserverBank
from lfd_observer.settings import BankSettings


class ObserverNode(Node):
    """One answer per horizon."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("observer_node", context=context, **node_options)
        settings = declare_settings(self, BankSettings, self._change)
        self._bank = self.create_publisher(ObserverBankMessage, "observer/bank", PIPELINE_QOS)
        self._message = ObserverBankMessage()
        self.create_subscription(PredictionHorizon, "mpc/horizon", self._on_horizon, PIPELINE_QOS)
        # What comes while the algorithm is loaded waits and is answered at once afterwards.
        ObserverBank(BankSettings()).step(first_horizon())
        self._core = ObserverBank(settings)
        self._health = StepHealth()
        HealthPublisher(self, self._statuses)
        ReadyAnnouncer(self, ["mpc/horizon"])

    def _change(self, settings: BankSettings) -> None:
        # Observers of other gains have nothing to do with those before: they start anew.
        self._core = ObserverBank(settings)

    def _statuses(self, _period_ends: bool) -> list[Health]:
        return [self._health.health("steps", time.monotonic(), {})]

    def _on_horizon(self, message: PredictionHorizon) -> None:
        begin = time.monotonic()
        try:
            horizon = from_message(Horizon, message)
            check_horizon(horizon)
            state = self._core.step(horizon)
        except ValueError as error:
            self._health.refuse(f"mpc/horizon: {error}")
            self.get_logger().error(f"mpc/horizon: {error}", throttle_duration_sec=1.0)
            return
        now = time.monotonic()
        self._health.step(now, state.stamp, now - begin)
        self._bank.publish(to_message(state, self._message))
