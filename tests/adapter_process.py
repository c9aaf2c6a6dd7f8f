"""Run by test_adapters where the car's message packages are there: adapter and graph in-process."""

import sys
from types import SimpleNamespace

from esr_frames import STATUS_4, encode, scan_frames
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu

from lfd_diagnosis.verdict import State
from lfd_mpc.messages import to_time
from lfd_msgs.msg import FaultReport
from lfd_replay.radar_adapter import SOURCES, RadarAdapterNode, message_class
from lfd_replay.recordings.recorded_messages import CAN_FRAME, ESR_STATUS_4, ESR_TRACK, RADAR_TRACKS
from ros_support import Graph


def stamped(message_type: str, stamp: int, **fields):
    message = message_class(message_type)(**fields)
    message.header.stamp = to_time(stamp)
    return message


def esr_tracks(stamp: int, scan: int) -> list:
    messages = [stamped(ESR_STATUS_4, stamp, path_id_acc=12)]
    for number in range(1, 65):
        fields = {"status": 3, "range": 30.0, "range_rate": -0.5} if number == 12 else {}
        messages.append(
            stamped(
                ESR_TRACK,
                stamp + number * 200_000,
                id=number,
                rolling_count=bool(scan % 2),
                **fields,
            )
        )
    return messages


def radar_tracks(stamp: int, _scan: int) -> list:
    track = message_class("radar_msgs/msg/RadarTrack")()
    track.uuid.uuid[0] = 7
    track.position.x, track.velocity.x = 30.0, -0.5
    return [stamped(RADAR_TRACKS, stamp, tracks=[track])]


def can_frames(stamp: int, scan: int) -> list:
    lead = {"STATUS": 3, "RANGE": 30.0, "RANGE_RATE": -0.5}
    blocked = encode(STATUS_4, PATH_ID_ACC_MOVE=12, SIDELOBE_BLOCKAGE=1)
    frames = [(0.0, 0x4E3, blocked), *scan_frames(0.0, scan, {12: lead})]
    return [
        stamped(CAN_FRAME, stamp + round(at * 1e9), id=identifier, dlc=8, data=list(data))
        for at, identifier, data in frames
    ]


MAKE = {"esr_tracks": esr_tracks, "radar_tracks": radar_tracks, "can_frames": can_frames}


def main(source: str) -> int:
    with Graph() as graph:
        graph.add_graph()
        arguments = ["--ros-args", "-p", f"source:={source}"]
        graph.add(RadarAdapterNode(graph.context, cli_args=arguments))
        car = graph.add(Node("car", context=graph.context))
        publishers = {
            message_type: car.create_publisher(message_class(message_type), topic, 1000)
            for topic, message_type in SOURCES[source].items()
        }
        imu = car.create_publisher(Imu, "vehicle/imu", 100)
        reports: list[FaultReport] = []
        car.create_subscription(
            FaultReport, "diagnosis/faults", reports.append, qos_profile_sensor_data
        )
        graph.spin_until(
            lambda: (
                all(p.get_subscription_count() for p in publishers.values())
                and imu.get_subscription_count()
                and car.count_publishers("/diagnosis/faults")
            ),
            "discovery",
        )
        position = SimpleNamespace(scan=0)

        def drive_on() -> bool:
            """Half a second more; whether the lead is followed."""
            for _ in range(10):
                stamp = 10_000_000_000 + position.scan * 50_000_000
                for message in MAKE[source](stamp, position.scan):
                    package = type(message).__module__.split(".")[0]
                    publishers[f"{package}/msg/{type(message).__name__}"].publish(message)
                graph.spin_for(0.04)
                for k in range(5):
                    felt = Imu()
                    felt.header.stamp = to_time(stamp + 20_000_000 + k * 10_000_000)
                    imu.publish(felt)
                graph.spin_for(0.02)
                position.scan += 1
            return any(report.clearance.state == State.OK for report in reports)

        graph.spin_until(drive_on, "a clearance that is OK", seconds=30.0)
        last = reports[-1]
        if source == "can_frames":
            assert last.clearance.reason.endswith("the radar says: sidelobe blockage"), last
        print("lead followed:", last.clearance.reason)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
