"""Pairs each horizon with the bank's answer to it: topics keep no order among each other."""

from lfd_mpc.horizon import Horizon
from lfd_observer.bank import BankState

PATIENCE = 0.5
"""Seconds of wall time that a horizon waits for its bank before it is judged without it. Those
after it do not wait, until the bank answers again."""

OVERTAKEN = 0.05
"""Seconds of wall time that it waits where a later one has been answered: one topic keeps its
order, so its answer is lost, or was sent before the diagnosis could hear it."""

BACKLOG = 2000
"""Answers of the bank that are kept for horizons still under way."""

Pair = tuple[Horizon, BankState | None]


class Pairing:
    """Hands out (horizon, bank) in the order of steps; `wall` is the present wall time in s."""

    def __init__(self) -> None:
        self._horizons: dict[tuple[int, int], tuple[Horizon, float]] = {}
        self._banks: dict[tuple[int, int], BankState] = {}
        self._bank_answers = True

    def add_horizon(self, horizon: Horizon, wall: float) -> list[Pair]:
        """Take a horizon; returns what is now complete, or has waited too long."""
        self._horizons[horizon.step, horizon.stamp] = horizon, wall
        return self.complete(wall)

    def add_bank(self, bank: BankState, wall: float) -> list[Pair]:
        """Take a bank's answer; returns what is now complete, or has waited too long."""
        self._banks[bank.step, bank.stamp] = bank
        self._bank_answers = True
        if len(self._banks) > BACKLOG:
            del self._banks[next(iter(self._banks))]
        return self.complete(wall)

    def complete(self, wall: float) -> list[Pair]:
        """What is complete, or has waited too long."""
        pairs: list[Pair] = []
        waiting = list(self._horizons.items())
        answered = max((n for n, (key, _) in enumerate(waiting) if key in self._banks), default=-1)
        for number, (key, (horizon, since)) in enumerate(waiting):
            if key not in self._banks:
                if number < answered:
                    waits = wall - since <= OVERTAKEN
                else:
                    waits = self._bank_answers = self._bank_answers and wall - since <= PATIENCE
                if waits:
                    break
            del self._horizons[key]
            pairs.append((horizon, self._banks.pop(key, None)))
        return pairs
