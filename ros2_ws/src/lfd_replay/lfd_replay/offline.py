"""The whole graph without ROS: the functions that the nodes call, one after the other.

`OfflineGraph.run` takes step by step what the nodes' cores take. `OfflineGraph.rows` lets one
compiled loop call the same functions and leaves every step as a row of an array; `outcomes` puts
rows into words.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.diagnosis import Diagnosis, RobustDiagnosis, make_diagnosis
from lfd_diagnosis.paper_diagnosis import paper_step
from lfd_diagnosis.robust_diagnosis import robust_step
from lfd_diagnosis.verdict import Event, Outcome
from lfd_mpc.arrival import push_sample
from lfd_mpc.compiled import borrowing, entry, inner
from lfd_mpc.errors import UserError
from lfd_mpc.horizon import HORIZON, STATUS_TEXTS, Horizon, Mpc, Progress, mpc_step
from lfd_mpc.samples import Sample, sample_array
from lfd_mpc.step_inputs import restart_reason
from lfd_observer.bank import BankState, ObserverBank, bank_step
from lfd_replay.profiles import GraphSettings

CHUNK = 512
"""Rows that are filled at once."""


def row_kind(outcome: np.dtype) -> np.dtype:
    """One step: its horizon without the arrays, what its texts are made of, and the outcome."""
    return np.dtype(
        [
            ("horizon", HORIZON),
            ("status", "i8"),
            ("text", "i8"),
            ("restart", "i8"),
            ("restart_values", "f8", (2,)),
            ("restart_tracks", "i8", (2,)),
            ("outcome", outcome),
        ],
        align=True,
    )


@borrowing
def _next_horizon(samples, sample, solved, control):
    """Go on to the next step; returns the next sample and what came of it."""
    samplers, model, mpcs, f, plan, states = control
    if solved:
        return sample, Progress.DONE
    while True:
        progress = mpc_step(samplers[0], model, mpcs[0], f, plan, states)
        if progress != Progress.NO_STEP or sample == len(samples):
            return sample, progress
        push_sample(samplers[0], samples[sample])
        sample += 1


@inner
def _fill(row, mpc, said):
    row.horizon, row.outcome = mpc.horizon, said
    row.status, row.text, row.restart = mpc.status, mpc.inputs.text, mpc.inputs.restart
    # One by one: to assign a slice takes seconds more to compile.
    for k in range(len(row.restart_values)):
        row.restart_values[k] = mpc.inputs.restart_values[k]
        row.restart_tracks[k] = mpc.inputs.restart_tracks[k]


ROBUST_PARTS = 3
"""State, settings and outcome; the paper's diagnosis has arrays, too, and so is told apart."""


@entry
def _run(samples, sample, rows, solved, control, bank, diagnosis):
    """Fill `rows` from `sample` on; returns the next sample, how many rows are filled, and what
    stopped it: `DONE` where the rows are full, `NO_STEP` where no sample is left, `UNSOLVED` where
    the next step wants another solver; it is `solved` when this is called again.
    """
    mpc, states = control[2][0], control[5]
    bank_state, arrays, answer = bank[0][0], bank[1], bank[2]
    state, said = diagnosis[0][0], diagnosis[-1][0]
    for k in range(len(rows)):
        sample, progress = _next_horizon(samples, sample, solved, control)
        solved = False
        if progress != Progress.DONE:
            return sample, k, progress
        bank_step(bank_state, arrays, mpc.horizon, states, answer)
        # A tuple's length is known when this is compiled: the other branch is left out.
        if len(diagnosis) == ROBUST_PARTS:
            robust_step(state, diagnosis[1][0], mpc.horizon, answer.values[0, 0], said)
        else:
            limits, settings = diagnosis[1], diagnosis[2][0]
            paper_step(state, limits, settings, mpc.horizon, states, True, bank_state, answer, said)
        _fill(rows[k], mpc, said)
    return sample, len(rows), Progress.DONE


@dataclass(frozen=True)
class GraphStep:
    """What every node says about one step."""

    horizon: Horizon
    bank: BankState
    outcome: Outcome


class OfflineGraph:
    """Controller, bank and diagnosis in one object; use either `push` and `run`, or `rows`."""

    def __init__(self, settings: GraphSettings) -> None:
        """Raises UserError for settings that cannot work."""
        try:
            self._mpc = Mpc(settings.mpc)
        except ValueError as error:
            raise UserError(f"mpc_node: {error}") from error
        self._bank = ObserverBank(settings.bank)
        self._diagnosis: Diagnosis = make_diagnosis(settings.diagnosis)
        self._anew_because = ""

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

    def rows(self, samples: Iterable[Sample]) -> Iterator[NDArray[np.void]]:
        """All steps of a drive, as arrays of at most `CHUNK` rows of `row_kind`."""
        mpc, bank, diagnosis = self._mpc, self._bank, self._diagnosis
        n = mpc.controller.steps
        f, plan, states = np.empty(n), np.empty(n), np.empty((n, 2))
        sampled = sample_array(samples, mpc.sampler.texts)
        control = mpc.sampler.state, mpc.controller.model, mpc.state, f, plan, states
        of_bank = bank.state, bank.arrays, bank.new_answer()
        if isinstance(diagnosis, RobustDiagnosis):
            own: tuple = diagnosis.state, diagnosis.numbers, diagnosis.outcome
        else:
            own = diagnosis.state, diagnosis.arrays, diagnosis.numbers, diagnosis.outcome
        kind = row_kind(diagnosis.outcome_kind)
        rows, filled, sample, solved = np.empty(CHUNK, kind), 0, 0, False
        while True:
            sample, count, progress = _run(
                sampled, sample, rows[filled:], solved, control, of_bank, own
            )
            filled += count
            solved = progress == Progress.UNSOLVED
            if solved:
                mpc.solve_outside(f, plan, states)
            elif progress == Progress.NO_STEP:
                yield rows[:filled]
                return
            else:
                yield rows
                rows, filled = np.empty(CHUNK, kind), 0

    def outcomes(self, rows: NDArray[np.void]) -> Iterator[Outcome]:
        """Each row of the next array of `rows` in words.

        None may be left out that starts anew: others say why it did.
        """
        texts = self._mpc.sampler.texts
        for row in rows:
            outcome = row["outcome"]
            if outcome["starts_anew"]:
                status = STATUS_TEXTS[int(row["status"])]
                self._anew_because = self._diagnosis.anew_because(restart_reason(row), status)
            text = texts.text(int(row["text"]))
            yield self._diagnosis.outcome_of(outcome, self._anew_because, text)

    def events(self, rows: NDArray[np.void]) -> Iterator[Event]:
        """The events of each row of the next array of `rows`: much faster than all outcomes."""
        said = rows["outcome"]
        for outcome in self.outcomes(rows[(said["changed"] != 0) | said["starts_anew"]]):
            yield from outcome.events
