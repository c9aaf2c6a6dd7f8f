"""What the robust profile learns of a signal, and how its lead track moves."""

from random import Random

import numpy as np
import pytest

from lfd_diagnosis.lead_track import (
    LEAD_TRACK,
    correct_clearance,
    correct_velocity,
    predict_track,
    start_track,
)
from lfd_diagnosis.noise import LEARNT_NOISE, deviation, learn_noise, start_noise
from lfd_diagnosis.repetition import (
    REPETITION,
    is_frozen,
    note_change,
    start_repetition,
    take_repetition,
)
from lfd_diagnosis.roughness import (
    ROUGHNESS,
    is_rough,
    resolution_of,
    start_roughness,
    take_roughness,
)
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.travelled_path import TRAVELLED_PATH, follow_path, skip_path, start_path
from lfd_mpc.compiled import make_state
from lfd_mpc.settings import settings_record


def test_a_vague_prediction_tells_nothing_of_the_noise() -> None:
    noise = make_state(LEARNT_NOISE)[0]
    start_noise(noise, (0.1, 0.01, 1.0), True, 400)
    learn_noise(noise, 20.0, 31.0 * 0.1**2)
    assert deviation(noise) == pytest.approx(0.1)
    learn_noise(noise, 20.0, 29.0 * 0.1**2)
    assert deviation(noise) > 0.2


def test_noise_is_learnt_from_a_first_value_within_limits() -> None:
    noise, fixed = make_state(LEARNT_NOISE)[0], make_state(LEARNT_NOISE)[0]
    start_noise(noise, (0.15, 0.03, 1.5), True, 400)
    start_noise(fixed, (0.15, 0.03, 1.5), False, 400)
    random = Random(3)
    for value in [random.gauss(0.0, 0.05) for _ in range(3000)]:
        learn_noise(noise, value, 0.0)
    assert deviation(noise) == pytest.approx(0.05, rel=0.1)
    for _ in range(3000):
        learn_noise(noise, 0.0, 0.0)
    assert deviation(noise) == pytest.approx(0.03)
    learn_noise(fixed, 9.0, 0.0)
    assert deviation(fixed) == pytest.approx(0.15)


def test_after_time_went_back_small_steps_must_prove_as_long_as_before() -> None:
    roughness = make_state(ROUGHNESS)[0]
    start_roughness(roughness, 16, 0.03)
    for k in range(300):
        take_roughness(roughness, 100.0 + 0.05 * k, float(7 * k % 3), True, 1.0)
    for k in range(190):
        take_roughness(roughness, 50.0 + 0.05 * k, 0.02 * k, True, 1.0)
    assert resolution_of(roughness) == 1.0
    for k in range(190, 500):
        take_roughness(roughness, 50.0 + 0.05 * k, 0.02 * k, True, 1.0)
    assert resolution_of(roughness) == pytest.approx(0.02)


def test_what_no_scan_follows_is_left_out_of_the_path_once() -> None:
    """As where the ids change while the clearance is not believed."""
    path, settings = make_state(TRAVELLED_PATH)[0], settings_record(DiagnosisSettings())[0]
    start_path(path, True)
    for k in range(20):
        follow_path(path, settings, 0.05 * k, 30.0, 0.0, 0.0)
    for k in range(20, 25):
        skip_path(path, 0.05 * k, 30.0, 0.0)
    follow_path(path, settings, 1.25, 30.0, 0.0, 0.0)
    assert path["skipped_time"] == pytest.approx(0.25)
    times = path["points"][: path["count"], 0]
    assert (np.diff(times) >= 0.0).all() and times[-1] == 1.25
    # Longer than that nothing is known of the path.
    skip_path(path, 2.0, 30.0, 0.0)
    assert path["count"] == 0


def test_roughness_is_blind_to_smooth_motion_and_to_one_outlier() -> None:
    roughness = make_state(ROUGHNESS)[0]
    start_roughness(roughness, 16, 0.0)
    random = Random(4)
    for k in range(200):
        value = 0.001 * k**2 + random.gauss(0.0, 0.05) + (k == 150)
        take_roughness(roughness, 0.05 * k, value, True, 0.0)
        assert not is_rough(roughness)
    for k in range(200, 216):
        take_roughness(roughness, 0.05 * k, random.gauss(0.0, 1.0), False, 0.0)
    assert is_rough(roughness)


def _stairs(roughness, first: int, seconds: int, healthy: bool, rate: float = 0.0) -> int:
    """A signal of 0.25 m a step at 20 Hz, which drifts away by so much a second."""
    random = Random(first)
    for k in range(20 * seconds):
        value = 0.25 * round(4.0 * random.gauss(0.0, 1.0)) + rate * 0.05 * k
        take_roughness(roughness, 0.05 * (first + k), value, healthy, 0.0)
    return first + 20 * seconds


def test_a_drift_teaches_no_resolution_until_it_is_found() -> None:
    roughness = make_state(ROUGHNESS)[0]
    start_roughness(roughness, 16, 0.0)
    at = _stairs(roughness, 0, 20, True)
    assert resolution_of(roughness) == pytest.approx(0.25)
    at = _stairs(roughness, at, 9, True, rate=-1.0)
    at = _stairs(roughness, at, 5, False, rate=-1.0)
    at = _stairs(roughness, at, 40, True)
    assert resolution_of(roughness) == pytest.approx(0.25)
    # What is healthy for longer is finer than it seemed.
    _stairs(roughness, at, 21, True, rate=-1.0)
    assert resolution_of(roughness) == pytest.approx(0.05)


def test_repetition_is_told_from_what_the_signal_used_to_do() -> None:
    lively, lazy = make_state(REPETITION)[0], make_state(REPETITION)[0]
    start_repetition(lively, 8)
    start_repetition(lazy, 8)
    random = Random(5)
    for _ in range(2000):
        take_repetition(lively, random.gauss(0.0, 1.0), True)
        take_repetition(lazy, float(random.randrange(2)), True)
    take_repetition(lively, 1.0, True)
    take_repetition(lazy, 5.0, True)
    for _ in range(8):
        assert not is_frozen(lively, True)
        take_repetition(lively, 1.0, True)
        take_repetition(lazy, 5.0, True)
        note_change(lively, True)
        note_change(lazy, True)
    assert is_frozen(lively, True)
    for _ in range(7):
        assert not is_frozen(lazy, True)
        take_repetition(lazy, 5.0, True)
        note_change(lazy, True)


def test_a_run_that_nothing_told_does_not_hide_the_next_hold_for_ever() -> None:
    signal = make_state(REPETITION)[0]
    start_repetition(signal, 8)
    random = Random(6)

    def lively(count: int) -> None:
        for _ in range(count):
            take_repetition(signal, float(random.randrange(3)), True)

    lively(1000)
    for _ in range(100):
        take_repetition(signal, 5.0, True)
        note_change(signal, False)
    lively(500)
    # Chance makes eleven of them, or thirteen; twice as many are none, however long the run before.
    take_repetition(signal, 5.0, True)
    for k in range(40):
        take_repetition(signal, 5.0, True)
        note_change(signal, True)
        assert k < 30 or is_frozen(signal, True)
        assert k > 20 or not is_frozen(signal, True)


def test_a_value_that_should_have_changed_only_now_is_not_held_yet() -> None:
    signal = make_state(REPETITION)[0]
    start_repetition(signal, 8)
    random = Random(6)
    for _ in range(500):
        take_repetition(signal, random.gauss(0.0, 1.0), True)
    for _ in range(12):
        take_repetition(signal, 5.0, True)
        note_change(signal, False)
    note_change(signal, True)
    assert not is_frozen(signal, True)
    take_repetition(signal, 5.0, True)
    note_change(signal, True)
    assert is_frozen(signal, True)


def test_the_track_follows_and_coasts_as_it_is_driven() -> None:
    track = make_state(LEAD_TRACK)[0]
    start_track(track, 30.0, 0.0, 0.0, 0.1**2, 0.05**2)
    clearance, velocity = 30.0, 0.0
    for k in range(300):
        velocity += 0.01 * (1.0 - 0.5)
        clearance += 0.01 * velocity
        predict_track(track, 0.01, 0.5, 1.0, 0.0, 3.0)
        if k % 5 == 0:
            correct_clearance(track, clearance - track["clearance"], 0.1**2)
            correct_velocity(track, velocity - track["velocity"], 0.05**2)
    assert track["acceleration"] == pytest.approx(1.0, abs=0.05)
    assert track["velocity"] == pytest.approx(velocity, abs=0.02)
    before = float(track["vv"])
    predict_track(track, 0.01, 0.5, 1.0, 0.0, 3.0)
    assert track["vv"] > before
