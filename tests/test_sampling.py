"""When steps happen, and which samples they use."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, LEAD_ACCELERATION, RadarSample, ScalarSample
from lfd_mpc.sampling import Sampler
from lfd_mpc.step_inputs import StepInputs

MS = 1_000_000


def radar(ms: float, clearance: float = 30.0, velocity: float = 0.0, **fields) -> RadarSample:
    return RadarSample(
        round(ms * MS), fields.pop("has_target", True), clearance, velocity, **fields
    )


def accel(ms: float, value: float = 0.1) -> ScalarSample:
    return ScalarSample(ACCELERATION, round(ms * MS), value)


def speed(ms: float) -> ScalarSample:
    return ScalarSample(HOST_SPEED, round(ms * MS), 15.0)


def run(sampler: Sampler, *samples) -> list[StepInputs]:
    return [step for sample in samples for step in sampler.push(sample)]


def healthy(sampler: Sampler, start: int, end: int) -> list[StepInputs]:
    """Radar every 50 ms and acceleration every 10 ms, in ms, end not included."""
    steps = []
    for ms in range(start, end, 10):
        if ms % 50 == 0:
            steps += sampler.push(radar(ms))
        steps += sampler.push(accel(ms))
    return steps


def times(steps: list[StepInputs]) -> list[float]:
    return [step.stamp / MS for step in steps]


def test_steps_are_whole_multiples_of_10_ms_released_by_acceleration() -> None:
    sampler = Sampler()
    assert run(sampler, radar(1.0)) == []
    assert times(run(sampler, accel(12.0))) == [10.0]
    assert times(run(sampler, accel(24.1))) == [20.0]
    assert times(run(sampler, accel(50.0))) == [30.0, 40.0, 50.0]


def test_an_acceleration_that_is_not_finite_releases_its_step_and_counts_as_bad() -> None:
    sampler = Sampler()
    run(sampler, radar(0), accel(0, 0.5))
    (step,) = run(sampler, accel(10, math.nan))
    assert step.acceleration.measured == 0.5 and step.bad_samples == 1


def test_each_step_uses_the_newest_sample_at_or_before_it() -> None:
    sampler = Sampler()
    run(sampler, radar(0, 30.0, -1.0), accel(0))
    run(sampler, radar(11, 40.0, -2.0))
    first, second = run(sampler, accel(20.0))
    assert first.clearance.measured == 30.0
    assert first.clearance_now == pytest.approx(30.0 - 1.0 * 0.01)
    assert second.clearance.measured == 40.0
    assert second.clearance_now == pytest.approx(40.0 - 2.0 * 0.009)


def test_the_order_of_arrival_does_not_matter_as_long_as_nothing_is_late() -> None:
    early, late = Sampler(), Sampler()
    one = run(early, radar(3), accel(5), speed(7), accel(15))
    other = run(late, accel(5), speed(7), radar(3), accel(15))
    # As text, since NaN equals nothing.
    assert str(one) == str(other) and one[-1].late_samples == 0


def test_a_sample_after_its_step_is_late_and_counts_from_the_next_step() -> None:
    sampler = Sampler()
    run(sampler, radar(0, 30.0), accel(0))
    (step,) = run(sampler, accel(10))
    run(sampler, radar(10, 33.0))
    (following,) = run(sampler, accel(20))
    assert step.clearance.measured == 30.0 and step.late_samples == 0
    assert following.clearance.measured == 33.0 and following.late_samples == 1


def test_a_silent_accelerometer_is_waited_for_50_ms_and_marked() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 100)
    assert run(sampler, radar(100), speed(149.9)) == []
    assert times(run(sampler, speed(150.0))) == [100.0]
    (step,) = run(sampler, speed(160.0))
    assert step.without_acceleration
    steps = run(sampler, accel(200.0))
    # Those that another input would have released by then are marked all the same.
    marked = [step for step in steps if step.without_acceleration]
    assert times(marked) == [120.0, 130.0, 140.0, 150.0] and len(steps) == 9


def test_the_clock_releases_what_a_silent_accelerometer_holds_back() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 100)
    run(sampler, radar(100))
    assert sampler.clock(149 * MS) == []
    (step,) = sampler.clock(150 * MS)
    assert step.stamp == 100 * MS and step.without_acceleration
    # After the newest input nobody can tell yet whether the gap is too long for steps.
    assert sampler.clock(300 * MS) == []


@pytest.mark.parametrize(("age", "stale"), [(140, False), (150, False), (160, True)])
def test_a_signal_is_stale_above_150_ms(age: int, stale: bool) -> None:
    sampler = Sampler()
    healthy(sampler, 0, 1000)
    last = 950
    steps = [s for ms in range(1000, last + age + 10, 10) for s in sampler.push(accel(ms))]
    assert steps[-1].stamp == (last + age) * MS
    assert steps[-1].clearance.stale is stale
    assert not steps[-1].acceleration.stale


@pytest.mark.parametrize(("age", "stale"), [(290, False), (300, False), (310, True)])
def test_a_slow_signal_is_stale_above_three_of_its_periods(age: int, stale: bool) -> None:
    sampler = Sampler()
    for ms in range(0, 2010 + age, 10):
        if ms % 100 == 0 and ms <= 2000:
            sampler.push(radar(ms))
        steps = sampler.push(accel(ms))
    assert steps[-1].stamp == (2000 + age) * MS
    assert steps[-1].relative_velocity.stale is stale


def test_a_short_gap_of_all_inputs_makes_its_steps() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 1000)
    steps = run(sampler, accel(1290))
    assert len(steps) == 30 and not any(step.restart_reason for step in steps)


def test_a_long_gap_of_all_inputs_makes_no_steps_and_restarts() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 1000)
    steps = run(sampler, accel(1300))
    assert times(steps) == [1300.0]
    assert "no input for 0.310 s" in steps[0].restart_reason
    assert steps[0].clearance.stale


@pytest.mark.parametrize(("late", "restarts"), [(-10.0, False), (0.0, False), (0.001, True)])
def test_the_longest_gap_is_five_periods_of_the_slowest_input(late: float, restarts: bool) -> None:
    sampler = Sampler()
    for ms in range(0, 1000, 10):
        if ms % 120 == 0:
            sampler.push(radar(ms))
        sampler.push(accel(ms))
    steps = run(sampler, accel(990 + 5 * 120 + late), accel(1600))
    assert len(steps) == (1 if restarts else 61)
    assert bool(steps[0].restart_reason) is restarts
    if restarts:
        assert "no input for 0.600 s" in steps[0].restart_reason


@pytest.mark.parametrize(("late", "refused"), [(-1e-6, 0), (0.0, 0), (1e-6, 1), (10.0, 1)])
def test_a_stamp_is_refused_that_is_more_than_a_second_ahead(late: float, refused: int) -> None:
    sampler = Sampler()
    healthy(sampler, 0, 100)
    run(sampler, radar(90 + 1000 + late, 99.0))
    (step, *_) = run(sampler, accel(100 if refused else 1100))
    assert step.refused_samples == refused
    assert ("no input for 1.000 s" in step.restart_reason) is (refused == 0)


def test_a_stamp_far_ahead_of_the_others_is_refused_and_disturbs_nothing() -> None:
    sampler, plain = Sampler(), Sampler()
    healthy(sampler, 0, 100)
    healthy(plain, 0, 100)
    assert run(sampler, radar(5000, 99.0)) == []
    steps, undisturbed = healthy(sampler, 100, 300), healthy(plain, 100, 300)
    assert [s.clearance for s in steps] == [s.clearance for s in undisturbed]
    assert steps[-1].refused_samples == 1 and undisturbed[-1].refused_samples == 0


def test_a_sensor_whose_clock_runs_ahead_stays_refused() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 100)
    for ms in range(100, 3000, 10):
        if ms % 50 == 0:
            run(sampler, radar(ms + 5000))
        steps = run(sampler, accel(ms))
    assert steps[-1].stamp == 2990 * MS and steps[-1].clearance.stale
    assert steps[-1].refused_samples >= 57


def test_a_single_stamp_that_goes_back_is_refused() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 500)
    assert run(sampler, accel(100)) == []
    (step,) = run(sampler, radar(500), accel(500))
    assert not step.restart_reason and step.refused_samples == 1


def test_time_that_really_goes_back_restarts() -> None:
    sampler = Sampler()
    healthy(sampler, 5000, 8000)
    steps = healthy(sampler, 0, 100)
    assert steps[0].restart_reason == "time went back by 7.990 s"
    assert times(steps) == [float(ms) for ms in range(0, 100, 10)]
    assert not steps[-1].clearance.stale and steps[-1].refused_samples == 0


@pytest.mark.parametrize("lone", [radar, accel])
def test_a_lone_sensor_whose_clock_goes_back_stays_refused(lone) -> None:
    sampler = Sampler()
    healthy(sampler, 10_000, 10_500)
    steps = []
    for ms in range(10_500, 14_000, 10):
        if ms % 50 == 0:
            steps += run(sampler, radar(ms - 5000 * (lone is radar)))
        steps += run(sampler, accel(ms - 5000 * (lone is accel)))
    assert not any(step.restart_reason for step in steps)
    assert steps[-1].stamp >= 13_900 * MS and steps[-1].refused_samples >= 65


def test_samples_that_arrive_in_the_wrong_order_are_refused_without_a_restart() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 100)
    steps = run(sampler, accel(100), accel(130), accel(110), accel(120), accel(140))
    assert times(steps) == [100.0, 110.0, 120.0, 130.0, 140.0]
    assert not any(step.restart_reason for step in steps) and steps[-1].refused_samples == 2


def test_a_lone_input_may_go_back_after_a_second() -> None:
    sampler = Sampler()
    healthy(sampler, 5000, 8000)
    steps = [s for ms in range(0, 1100, 10) for s in sampler.push(accel(ms))]
    assert steps[0].restart_reason == "time went back by 7.990 s"
    assert steps[-1].stamp == 1090 * MS


@pytest.mark.parametrize("off", [3_600_000, -3_600_000])
@pytest.mark.parametrize("wrong", [radar, accel, speed])
@pytest.mark.parametrize("first", [True, False])
def test_one_input_whose_clock_is_wrong_from_the_start_is_outvoted(
    first: bool, wrong, off: int
) -> None:
    """Whether it is heard first or last."""
    sampler, start = Sampler(), 4_000_000
    rest = [make for make in (radar, accel, speed) if make is not wrong]
    made = []
    for ms in range(start, start + 2000, 10):
        makers = [wrong, *rest] if first else [*rest, wrong]
        for make in makers:
            if make is accel or ms % 50 == 0:
                made += run(sampler, make(ms + off * (make is wrong)))
    right = [step for step in made if abs(step.stamp - start * MS) < 2_000_000_000]
    assert made[-1] is right[-1] and right[-1].stamp >= (start + 1900) * MS
    assert [step for step in made if step.restart_reason][-1].stamp <= (start + 100) * MS
    assert right[-1].refused_samples >= 35
    stale = {
        radar: right[-1].clearance.stale,
        accel: right[-1].acceleration.stale,
        speed: right[-1].host_speed.stale,
    }
    assert stale == {make: make is wrong for make in stale}


def test_a_wrong_clock_that_was_alone_for_a_while_is_outvoted() -> None:
    sampler = Sampler()
    healthy(sampler, 4_000_000, 4_001_000)
    for ms in range(4_001_000, 4_004_000, 50):
        run(sampler, speed(ms + 3_600_000))
    made = []
    for ms in range(4_004_000, 4_005_000, 10):
        if ms % 50 == 0:
            made += run(sampler, speed(ms + 3_600_000), radar(ms))
        made += run(sampler, accel(ms))
    assert made[-1].stamp == 4_004_990 * MS and not made[-1].clearance.stale


def test_two_inputs_that_come_late_after_a_gap_make_no_time_go_back() -> None:
    """A stall of more than a second; the third topic, which missed some, comes first."""
    sampler = Sampler()
    healthy(sampler, 0, 2000)
    run(sampler, *(speed(ms) for ms in range(0, 2000, 50)))
    made = run(sampler, *(speed(ms) for ms in range(2300, 3100, 50)))
    late = [radar(2000), *(accel(ms) for ms in range(2000, 3070, 10)), radar(3070)]
    made += run(sampler, *late, *(accel(ms) for ms in range(3070, 3200, 10)))
    stamps = times(made)
    assert stamps == sorted(set(stamps)) and stamps[-1] == 3190.0


def test_a_jump_forward_of_all_inputs_restarts() -> None:
    sampler = Sampler()
    healthy(sampler, 0, 1000)
    steps = healthy(sampler, 60_000, 60_100)
    assert steps[0].stamp == 60_000 * MS and "no input for 59." in steps[0].restart_reason


def test_a_lone_input_may_jump_forward_after_a_second() -> None:
    sampler = Sampler()
    for ms in range(0, 100, 10):
        run(sampler, accel(ms))
    steps = [s for ms in range(60_000, 61_100, 10) for s in sampler.push(accel(ms))]
    assert steps and "no input" in " ".join(step.restart_reason for step in steps)


@pytest.mark.parametrize(
    ("before", "after", "restarts"), [(5, 6, True), (5, 5, False), (-1, 6, False), (5, -1, False)]
)
def test_only_a_new_known_track_is_a_new_lead(before: int, after: int, restarts: bool) -> None:
    sampler = Sampler()
    run(sampler, radar(0, track_id=before), accel(0))
    (step,) = run(sampler, radar(10, track_id=after), accel(10))
    assert bool(step.restart_reason) is restarts
    if restarts:
        assert step.restart_reason == "new lead: track 5 became 6"


def test_an_empty_road_is_no_silence() -> None:
    sampler = Sampler()
    run(sampler, radar(0), accel(0))
    (step,) = run(sampler, radar(10, math.nan, math.nan, has_target=False), accel(10))
    assert not step.has_target and not step.clearance.stale
    assert math.isnan(step.clearance.measured) and step.bad_samples == 0


STAMPS = st.one_of(
    st.integers(0, 2_000_000_000),
    st.integers(-(2**62), 2**62),
    st.sampled_from([0, 10 * MS, 1_700_000_000_000_000_000]),
)
VALUES = st.floats(allow_nan=True, allow_infinity=True)
SAMPLES = st.one_of(
    st.builds(RadarSample, STAMPS, st.booleans(), VALUES, VALUES, st.integers(-1, 3)),
    st.builds(ScalarSample, st.sampled_from([ACCELERATION, HOST_SPEED]), STAMPS, VALUES),
)


@settings(max_examples=300, deadline=None)
@given(st.lists(SAMPLES, max_size=40))
def test_whatever_arrives_steps_count_up_and_stay_bounded(samples) -> None:
    sampler = Sampler()
    steps = []
    for sample in samples:
        released = sampler.push(sample)
        # No sample can release more than what lies within the longest gap that makes steps.
        assert len(released) < 10_000
        steps += released
    assert [step.step for step in steps] == list(range(1, len(steps) + 1))
    assert all(step.stamp % (10 * MS) == 0 for step in steps)


def said(ms: float, value: float = -1.0) -> ScalarSample:
    return ScalarSample(LEAD_ACCELERATION, round(ms * MS), value)


def test_the_leads_word_is_used_but_neither_releases_nor_delays_steps() -> None:
    sampler = Sampler()
    assert run(sampler, said(0.0)) == [], "nothing is known of the time yet"
    steps = healthy(sampler, 0, 100)
    assert all(step.lead_acceleration.stale for step in steps)
    assert run(sampler, said(95.0), said(900.0)) == []
    (step,) = run(sampler, accel(100.0))
    assert step.lead_acceleration.measured == -1.0 and not step.lead_acceleration.stale
    assert step.lead_acceleration.age == pytest.approx(0.005)
    steps = healthy(sampler, 110, 400)
    assert times(steps) == [float(ms) for ms in range(110, 400, 10)]
    assert steps[-1].lead_acceleration.stale, "silence of the lead is its own"


def test_what_the_lead_stamps_far_from_now_or_twice_is_refused() -> None:
    sampler = Sampler()
    healthy(sampler, 2000, 2100)
    run(sampler, said(2090.0), said(2090.0, 5.0), said(3200.0), said(1000.0))
    (step,) = run(sampler, accel(2100.0))
    assert step.lead_acceleration.measured == -1.0 and step.refused_samples == 3


def test_a_lead_that_speaks_rarely_does_not_widen_the_largest_gap() -> None:
    sampler = Sampler()
    steps = []
    for start in range(0, 4000, 400):
        steps += healthy(sampler, start, start + 400)
        sampler.push(said(start + 395))
    steps = healthy(sampler, 4400, 4500)
    assert steps[0].restart_reason.startswith("no input for")


def test_after_a_gap_late_samples_of_another_input_make_no_step_twice() -> None:
    """Under load topics arrive apart: the radar's newest before the acceleration's older ones."""
    sampler = Sampler()
    steps = healthy(sampler, 0, 2500)
    steps += run(sampler, *(radar(ms) for ms in (2500, 2550, 2600, 2650)))
    made = times(steps)[-1]
    assert made == 2600.0, "released by the radar, without the acceleration"
    assert times(run(sampler, radar(3300))) == [2610.0, 2620.0, 2630.0, 2640.0, 2650.0]
    later = run(sampler, *(accel(ms) for ms in range(2480, 3310, 10)))
    assert later[0].restart_reason.startswith("no input for 0.650 s")
    assert times(later) == [float(ms) for ms in range(2660, 3310, 10)]
    assert later[-1].late_samples >= 18, "those of 2480 to 2650 ms"


@settings(max_examples=200, deadline=None)
@given(
    st.integers(20, 150),
    st.tuples(*[st.integers(0, 60)] * 3),
    st.tuples(*[st.integers(0, 150)] * 3),
    st.tuples(*[st.integers(0, 150)] * 3),
)
def test_a_stall_never_makes_a_step_twice(stall: int, apart, lost_from, lost) -> None:
    """Each topic in its own order, held up by a stall, some of it lost; in steps of 10 ms."""
    arriving = []
    for number, (make, period) in enumerate(((radar, 5), (speed, 5), (accel, 1))):
        before = 0
        for k in range(0, 500, period):
            begin = 200 + lost_from[number]
            if begin <= k < begin + lost[number]:
                continue
            free = 200 + stall + apart[number]
            before = max(before, free if 200 <= k < free else k)
            arriving.append((before, number, make(10.0 * k)))
    arriving.sort(key=lambda item: item[:2])
    stamps = times(run(Sampler(), *(sample for _, _, sample in arriving)))
    assert stamps == sorted(set(stamps))
