"""Executables of this package; what they compute with is imported when they have joined ROS."""

from lfd_mpc.node_process import run_node


def diagnosis_node() -> int:
    """Entry point of `lfd_diagnosis diagnosis_node`."""

    def load() -> type:
        from lfd_diagnosis.diagnosis_node import DiagnosisNode

        return DiagnosisNode

    return run_node(load)


def decision_node() -> int:
    """Entry point of `lfd_diagnosis decision_node`."""

    def load() -> type:
        from lfd_diagnosis.decision_node import DecisionNode

        return DecisionNode

    return run_node(load)
