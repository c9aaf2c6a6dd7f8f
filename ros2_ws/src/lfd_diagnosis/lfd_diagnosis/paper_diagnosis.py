"""The paper's diagnosis: indices of what disagrees, counted into confidence (eqs 25, 26)."""

from math import isnan, sqrt
from typing import NamedTuple

import numpy as np

from lfd_diagnosis.confidence import next_confidence
from lfd_diagnosis.fault_index import PredictionLimits, is_outside
from lfd_diagnosis.report_book import BOOK, enter_outcome
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind, State, outcome_kind
from lfd_mpc.arrays import Array
from lfd_mpc.compiled import entry, inner
from lfd_mpc.settings import STEP_S
from lfd_observer.prediction_store import (
    STORE,
    clear_store,
    follow,
    predicted_now,
    push_solution,
)

PAPER_EVIDENCE = np.dtype(
    [
        ("clearance_count", "i8"),
        ("relative_velocity_count", "i8"),
        ("clearance", "f8"),
        ("relative_velocity", "f8"),
        ("acceleration", "f8"),
        ("clearance_age", "f8"),
        ("relative_velocity_age", "f8"),
        ("acceleration_age", "f8"),
        ("observers", "i8"),
        ("observer_count", "i8"),
        ("lower", "f8"),
        ("upper", "f8"),
        ("answered", "?"),
        ("stored", "i8"),
        ("stored_now", "i8"),
        ("complete", "?"),
        ("silent", "?"),
    ],
    align=True,
)
"""Figures that the reasons of an outcome are made of."""

PAPER_OUTCOME = outcome_kind(PAPER_EVIDENCE)

PAPER_STATE = np.dtype(
    [
        ("store", STORE),
        ("book", BOOK),
        ("clearance_confidence", "i8"),
        ("relative_velocity_confidence", "i8"),
        ("acceleration_confidence", "i8"),
        ("stored", "i8"),
    ],
    align=True,
)
"""State of the paper's diagnosis."""


class PaperArrays(NamedTuple):
    """`solutions` (N, N, 2) of the store; `lower` and `upper` (N, 2) of `PredictionLimits`."""

    solutions: Array
    lower: Array
    upper: Array


def paper_arrays(settings: DiagnosisSettings) -> PaperArrays:
    """Arrays for the diagnosis with these settings."""
    n = settings.prediction_steps
    limits = PredictionLimits(settings)
    return PaperArrays(np.full((n, n, 2), np.nan), limits.lower, limits.upper)


@inner
def start_paper(state):
    """Forget confidence and stored predictions: everything is judged anew."""
    clear_store(state.store)
    state.store.followed = False
    state.clearance_confidence = state.relative_velocity_confidence = 0
    state.acceleration_confidence = state.stored = 0


@inner
def _say(verdict, settings, state, index, threshold, confidence):
    """The verdict on one signal; where it has an index its state is decided by confidence."""
    if not isnan(index):
        state = State.SUSPECT if confidence > 0 else State.OK
        if confidence >= settings.confidence_threshold:
            state = State.FAULT
    verdict.state, verdict.kind = state, Kind.UNKNOWN
    verdict.index, verdict.threshold = index, threshold
    verdict.confidence = confidence
    verdict.confidence_threshold = settings.confidence_threshold
    verdict.size = verdict.size_std = np.nan


@inner
def _not_judged(verdict):
    """The paper needs no evidence beyond its own."""
    verdict.state, verdict.kind = State.NOT_READY, Kind.UNKNOWN
    verdict.index = verdict.threshold = verdict.size = verdict.size_std = np.nan
    verdict.confidence = verdict.confidence_threshold = 0


@inner
def _radar_state(state, horizon, used, stale):
    """State of a radar signal that has no index; OK stands for one that has."""
    if stale:
        return State.NO_DATA
    if not horizon.has_target and not horizon.valid:
        return State.NO_TARGET
    return State.OK if state.store.complete and not isnan(used) else State.NOT_READY


@inner
def _judge_radar(state, arrays, settings, horizon, outcome):
    store, solutions = state.store, arrays.solutions
    evidence, n = outcome.evidence, len(arrays.lower)
    clearances = velocities = 0
    for i in range(n):
        predicted = predicted_now(store, solutions, i + 1, 0)
        clearances += is_outside(
            horizon.clearance, predicted, arrays.lower[i, 0], arrays.upper[i, 0]
        )
        predicted = predicted_now(store, solutions, i + 1, 1)
        velocities += is_outside(
            horizon.relative_velocity, predicted, arrays.lower[i, 1], arrays.upper[i, 1]
        )
    evidence.clearance_count, evidence.relative_velocity_count = clearances, velocities
    evidence.clearance = horizon.clearance
    evidence.relative_velocity = horizon.relative_velocity
    evidence.clearance_age = horizon.clearance_age
    evidence.relative_velocity_age = horizon.relative_velocity_age
    ceiling = settings.confidence_max

    found = _radar_state(state, horizon, horizon.clearance, horizon.clearance_stale)
    index = clearances / n if found == State.OK else np.nan
    threshold = settings.clearance_threshold
    confidence = next_confidence(state.clearance_confidence, index, threshold, ceiling)
    state.clearance_confidence = confidence
    _say(outcome.clearance, settings, found, index, threshold, confidence)

    velocity = horizon.relative_velocity
    found = _radar_state(state, horizon, velocity, horizon.relative_velocity_stale)
    index = velocities / n if found == State.OK else np.nan
    threshold = settings.relative_velocity_threshold
    confidence = next_confidence(state.relative_velocity_confidence, index, threshold, ceiling)
    state.relative_velocity_confidence = confidence
    _say(outcome.relative_velocity, settings, found, index, threshold, confidence)


@inner
def _judge_acceleration(state, settings, horizon, answered, index, outcome):
    found = State.NOT_READY
    if horizon.acceleration_stale:
        found, index = State.NO_DATA, np.nan
    elif not answered:
        index = np.nan
    threshold, ceiling = settings.acceleration_threshold, settings.confidence_max
    confidence = next_confidence(state.acceleration_confidence, index, threshold, ceiling)
    state.acceleration_confidence = confidence
    _say(outcome.acceleration, settings, found, index, threshold, confidence)
    outcome.evidence.acceleration = horizon.acceleration
    outcome.evidence.acceleration_age = horizon.acceleration_age


@inner
def paper_step(state, arrays, settings, horizon, states, answered, bank, answer, outcome):
    """Answer one horizon, whose prediction is `states` (N, 2).

    `bank` and `answer` are the bank's state and answer to the same horizon, if it has `answered`.
    """
    store, evidence = state.store, outcome.evidence
    outcome.stamp, outcome.step = horizon.stamp, horizon.step
    follow(store, arrays.solutions, horizon)
    outcome.starts_anew = store.anew
    if store.anew:
        state.stored = 0
    evidence.silent, evidence.answered = False, answered
    evidence.stored, evidence.complete = state.stored, store.complete
    evidence.observers, evidence.observer_count = 0, len(answer.outside)
    if answered:
        for i in range(len(answer.outside)):
            evidence.observers += answer.outside[i]
        evidence.lower, evidence.upper = answer.values[2, 0], answer.values[3, 0]
    _judge_radar(state, arrays, settings, horizon, outcome)
    index = bank.acceleration_index
    _judge_acceleration(state, settings, horizon, answered, index, outcome)
    _not_judged(outcome.host_speed)
    _not_judged(outcome.lead_acceleration)
    relative = answer.values[0, 0] if answered and bank.ready else np.nan
    enter_outcome(state.book, outcome)
    _reconstruct(state, arrays, settings, relative, outcome)
    state.stored = min(state.stored + horizon.valid, len(arrays.lower))
    evidence.stored_now = state.stored
    if horizon.valid:
        push_solution(store, arrays.solutions, states)


@inner
def _reconstruct(state, arrays, settings, relative, outcome):
    """What the signals should be (eqs 10, 21, 22).

    The oldest prediction is taken because it is the last to learn from a faulty measurement.
    """
    made, complete, n = outcome.reconstructed, state.store.complete, len(arrays.lower)
    tau, sigma = STEP_S * n, settings.lead_acceleration_std
    made.clearance_valid = made.relative_velocity_valid = complete
    made.clearance = made.relative_velocity = np.nan
    made.clearance_std = made.relative_velocity_std = np.nan
    if complete:
        made.clearance = predicted_now(state.store, arrays.solutions, n, 0)
        made.relative_velocity = predicted_now(state.store, arrays.solutions, n, 1)
        made.clearance_std = sqrt(settings.clearance_std**2 + (0.5 * sigma * tau**2) ** 2)
        made.relative_velocity_std = sqrt(settings.relative_velocity_std**2 + (sigma * tau) ** 2)
    made.relative_acceleration_valid = not isnan(relative)
    made.relative_acceleration = relative
    acceleration = settings.lead_acceleration_mean - relative
    if outcome.radar.state == State.FAULT:
        acceleration = np.nan
    made.acceleration_valid = not isnan(acceleration)
    made.acceleration = acceleration
    made.acceleration_std = sigma if made.acceleration_valid else np.nan


@inner
def paper_silence(state, settings, stamp, outcome):
    """Nothing arrives at all: what is said (of no step) at `stamp` (ns).

    Steps that come late go on where they were: what counts is told by stamps, not by this.
    """
    outcome.stamp, outcome.step, outcome.starts_anew = stamp, 0, False
    outcome.evidence.silent = True
    nothing, threshold = State.NO_DATA, settings.clearance_threshold
    _say(outcome.clearance, settings, nothing, np.nan, threshold, 0)
    threshold = settings.relative_velocity_threshold
    _say(outcome.relative_velocity, settings, nothing, np.nan, threshold, 0)
    _say(outcome.acceleration, settings, nothing, np.nan, settings.acceleration_threshold, 0)
    _not_judged(outcome.host_speed)
    _not_judged(outcome.lead_acceleration)
    enter_outcome(state.book, outcome)


@entry
def start_paper_entry(state):
    """`start_paper` for callers from outside."""
    start_paper(state[0])


@entry
def paper_step_entry(states_, arrays, numbers, horizons, states, answered, banks, answer, outcomes):
    """`paper_step` for callers from outside."""
    state, settings, horizon = states_[0], numbers[0], horizons[0]
    said = outcomes[0]
    paper_step(state, arrays, settings, horizon, states, answered, banks[0], answer, said)


@entry
def paper_silence_entry(state, settings, stamp, outcome):
    """`paper_silence` for callers from outside."""
    paper_silence(state[0], settings[0], stamp, outcome[0])
