"""What the nodes publish is what the offline evaluation says, message by message."""

import pytest

from lfd_bringup.recorder import RecorderNode
from lfd_diagnosis.verdict import State
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RadarSample,
    ScalarSample,
    playing_order,
)
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.player import GRAPH_NODES, PlayerNode, PlayOptions
from ros_support import (
    REPLAY_ARGUMENTS,
    Graph,
    assert_live_equals_offline,
    offline,
    profile_arguments,
    recorded,
)

SECONDS = 3.0


def drive(seconds: float = SECONDS) -> list:
    """A lead that brakes gently, radar at 20 Hz, acceleration at 100 Hz, speed at 83 Hz."""
    samples = []
    for i in range(round(seconds * 20)):
        t = i * 0.05
        samples.append(
            RadarSample(i * 50_000_000, True, 30.0 + 0.2 * t - 0.15 * t * t, 0.2 - 0.3 * t, 7)
        )
    samples += [
        ScalarSample(ACCELERATION, i * 10_000_000, 0.1 + 0.01 * (i % 7))
        for i in range(round(seconds * 100))
    ]
    samples += [
        ScalarSample(HOST_SPEED, 4_000_000 + i * 12_000_000, 15.0 + 0.001 * i)
        for i in range(round(seconds * 83))
    ]
    samples += [
        ScalarSample(LEAD_ACCELERATION, 7_000_000 + i * 100_000_000, -0.3)
        for i in range(round(seconds * 10))
    ]
    return sorted(samples, key=playing_order)


def with_fault(text: str) -> list:
    return FaultInjector(parse_faults([text]), 0, seed=0).apply(drive())


def play_live(samples: list, rate: float, profile: str = "robust") -> dict[str, list]:
    with Graph() as graph:
        graph.add_graph(profile_arguments(profile))
        recorder = graph.add(RecorderNode(lambda event: None, context=graph.context))
        graph.play(samples, rate, [*GRAPH_NODES, "recorder"])
        wanted = {topic: len(records) for topic, records in offline(samples, profile).items()}
        graph.spin_until(
            lambda: all(recorder.count(topic) >= count for topic, count in wanted.items()),
            f"as many messages as offline: {wanted}",
            seconds=5.0,
        )
        return recorded(recorder)


@pytest.mark.parametrize("profile", ["robust", "paper"])
@pytest.mark.parametrize(
    "fault",
    [
        "",
        "offset:clearance=4,relative_velocity=-10@1-2",
        "offset:acceleration=4@1-2",
        "dropout:radar@1-1.6",
        "dropout:clearance@1-1.6",
        "dropout:acceleration@1-1.6",
        "dropout:host_speed@1-1.6",
        "dropout:radar@1-1.5;dropout:acceleration@1-1.5;dropout:host_speed@1-1.5",
        "noise:acceleration=1@0-3;hold:radar@1-2",
    ],
)
def test_lockstep_gives_what_offline_gives(fault: str, profile: str) -> None:
    samples = with_fault(fault)
    live = play_live(samples, rate=0.0, profile=profile)
    assert_live_equals_offline(live, offline(samples, profile))


@pytest.mark.alone
def test_free_rate_gives_what_offline_gives_when_nothing_was_late() -> None:
    samples = with_fault("offset:acceleration=4@1-2")
    own = offline(samples)
    held_up = []
    # A machine that is busy holds up a run now and then; one that is slow is given more time.
    for rate in (1.0, 0.5, 0.25):
        live = play_live(samples, rate)
        late = live["mpc/horizon"][-1].late_samples
        silent = silences(live) - silences(own)
        if not late and not silent:
            assert_live_equals_offline(live, own)
            return
        held_up.append(f"rate {rate}: {late} samples late, {silent} times nothing arrived")
    pytest.fail("; ".join(held_up))


def silences(records: dict[str, list]) -> int:
    """How often a signal went silent: live, where nothing arrives, a wall timer says so, too."""
    return sum(event.fault.state == State.NO_DATA for event in records["diagnosis/events"])


def test_a_new_lead_and_an_empty_road_are_the_same_live() -> None:
    samples = []
    for sample in drive():
        if isinstance(sample, RadarSample) and sample.stamp >= 1_000_000_000:
            if sample.stamp < 1_500_000_000:
                sample = RadarSample(sample.stamp, False, float("nan"), float("nan"))
            else:
                sample = RadarSample(sample.stamp, True, sample.clearance + 9.0, 0.5, 8)
        samples.append(sample)
    assert_live_equals_offline(play_live(samples, rate=0.0), offline(samples))


def test_the_order_in_which_radar_and_acceleration_arrive_does_not_matter() -> None:
    """Samples of one stamp are sent with the acceleration first; queues are emptied by stamp."""
    samples = drive(1.0)
    own = offline(samples)
    with Graph() as graph:
        graph.add_graph(REPLAY_ARGUMENTS)
        recorder = graph.add(RecorderNode(lambda event: None, context=graph.context))
        # The player only lends its publishers here.
        player = graph.add(
            PlayerNode(samples, PlayOptions(), [*GRAPH_NODES, "recorder"], graph.context)
        )
        graph.spin_until(lambda: not player.waiting_for, "every node is ready")
        step = []
        for sample in [*samples, None]:
            if sample is not None and (not step or sample.stamp == step[0].stamp):
                step.append(sample)
                continue
            for swapped in reversed(step):
                player._send(swapped)
            graph.executor.spin_once(timeout_sec=0.01)
            step = [sample]
        graph.spin_until(
            lambda: recorder.count("diagnosis/reconstructed") >= len(own["mpc/horizon"]),
            "every step is answered",
        )
        assert_live_equals_offline(recorded(recorder), own)
