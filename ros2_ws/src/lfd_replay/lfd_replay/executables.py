"""Executables of this package."""

from lfd_mpc.starting import command, node

bag_player = command("lfd_replay.bag_player")
calibrate = command("lfd_replay.calibrate")
check_requirements = command("lfd_replay.check_requirements")
evaluate = command("lfd_replay.evaluate")
fault_injector = node("lfd_replay.fault_injector", "FaultInjectorNode")
host_adapter = node("lfd_replay.host_adapter", "HostAdapterNode")
import_drive = command("lfd_replay.import_drive")
inspect = command("lfd_replay.inspect")
make_drive = command("lfd_replay.make_drive")
paper_evaluation = command("lfd_replay.paper_evaluation")
radar_adapter = node("lfd_replay.radar_adapter", "RadarAdapterNode")
