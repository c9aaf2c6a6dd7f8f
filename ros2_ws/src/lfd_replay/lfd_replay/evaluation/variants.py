"""The graph as published, and with one part taken out: what the parts are worth."""

from collections.abc import Iterable

from lfd_mpc.samples import Sample
from lfd_replay.evaluation.detectors import PUBLISHED
from lfd_replay.evaluation.trace import Trace, record_trace
from lfd_replay.offline import OfflineGraph
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


def trace_variants(
    chosen: dict[str, GraphSettings], samples: Iterable[Sample], zero: int
) -> dict[str, Trace]:
    """The same samples through several variants."""
    samples = list(samples)
    return {
        name: record_trace(OfflineGraph(settings).rows(samples), zero)
        for name, settings in chosen.items()
    }
