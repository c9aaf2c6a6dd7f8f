"""The diagnosis without ROS, of either profile: a horizon and its bank in, one report out."""

from lfd_diagnosis.paper_diagnosis import PaperDiagnosis
from lfd_diagnosis.robust_diagnosis import RobustDiagnosis
from lfd_diagnosis.settings import DiagnosisSettings

Diagnosis = PaperDiagnosis | RobustDiagnosis


def make_diagnosis(settings: DiagnosisSettings) -> Diagnosis:
    """The diagnosis of the profile that the settings name."""
    return PaperDiagnosis(settings) if settings.profile == "paper" else RobustDiagnosis(settings)
