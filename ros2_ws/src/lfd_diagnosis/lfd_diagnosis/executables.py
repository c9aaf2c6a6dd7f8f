"""Executables of this package."""

from lfd_mpc.starting import node

decision_node = node("lfd_diagnosis.decision_node", "DecisionNode")
diagnosis_node = node("lfd_diagnosis.diagnosis_node", "DiagnosisNode")
