"""Executables of this package."""

from lfd_mpc.starting import command

compile_all = command("lfd_bringup.compile_all")
replay = command("lfd_bringup.joined_replay")
simulate = command("lfd_bringup.simulate")
