"""Executables of this package."""

from lfd_mpc.starting import node

observer_node = node("lfd_observer.observer_node", "ObserverNode")
