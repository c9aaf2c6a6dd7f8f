"""Executables of this package."""

from lfd_mpc.starting import command, node

closed_loop_evaluation = command("lfd_vehicle.closed_loop_evaluation")
vehicle_node = node("lfd_vehicle.vehicle_node", "VehicleNode")
