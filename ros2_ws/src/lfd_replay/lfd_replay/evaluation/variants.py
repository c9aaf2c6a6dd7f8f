"""The graph as published, and with one part taken out: what the parts are worth."""

from lfd_replay.evaluation.detectors import PUBLISHED
from lfd_replay.profiles import GraphSettings

SINGLE, LINEAR = "single observer", "linear prediction"


def variants(settings: GraphSettings) -> dict[str, GraphSettings]:
    """Settings of each variant by name: switches of the same code."""
    single = settings.bank.model_copy(update={"lags": settings.bank.lags[:1]})
    linear = settings.mpc.model_copy(update={"prediction": "linear"})
    return {
        PUBLISHED: settings,
        SINGLE: GraphSettings(settings.mpc, single, settings.diagnosis),
        LINEAR: GraphSettings(linear, settings.bank, settings.diagnosis),
    }
