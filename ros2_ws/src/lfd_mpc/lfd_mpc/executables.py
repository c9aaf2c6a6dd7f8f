"""Executables of this package."""

from lfd_mpc.starting import node

mpc_node = node("lfd_mpc.mpc_node", "MpcNode")
