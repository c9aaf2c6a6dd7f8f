"""Compile everything that is compiled once after installation, so that no node has to.

Without it the first start of a node after installation or a change of the sources takes longer.
"""

import argparse
import shutil
import time
from collections.abc import Sequence

import numpy as np

from lfd_diagnosis.confidence import confidences
from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.fault_index import PredictionLimits
from lfd_mpc.compiled import cache_folder
from lfd_mpc.driving import DrivingMpc
from lfd_mpc.horizon import first_horizon
from lfd_mpc.samples import Sample
from lfd_mpc.sampling import Sampler
from lfd_mpc.settings import MpcSettings
from lfd_observer.prediction_store import PredictionStore
from lfd_replay.errors import run_command
from lfd_replay.generated.generate import generate_drive
from lfd_replay.journal import workers
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, graph_settings
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.vehicle import Vehicle

COMPLETE = "complete"
"""File that is there once everything has been compiled."""

SAMPLES = 400
"""Samples of a drive that call every compiled function."""


def compile_all() -> None:
    """Call every compiled function once, and remove what was compiled from other sources."""
    for profile in PROFILES:
        _profile(profile)
    _outside_a_profile()
    folder = cache_folder()
    if folder.is_dir():
        for other in folder.parent.glob("compiled-*"):
            if other != folder:
                shutil.rmtree(other, ignore_errors=True)
        (folder / COMPLETE).touch()


def _samples() -> Sequence[Sample]:
    return generate_drive("data-1", 0, "esr").samples[:SAMPLES]


def _profile(name: str) -> None:
    settings, samples = graph_settings(name), _samples()
    for _ in OfflineGraph(settings).run(samples):
        pass
    for _ in OfflineGraph(settings).rows(samples):
        pass
    make_diagnosis(settings.diagnosis).silence(0)


def _outside_a_profile() -> None:
    _control(_samples())
    _drawings()
    Vehicle(VehicleSettings(), 0.0, 20.0).step(0.0)


def _control(samples: Sequence[Sample]) -> None:
    """What live input, driving and other solvers need beyond an evaluation."""
    sampler = Sampler()
    mpc = DrivingMpc(MpcSettings(solver="proxqp", driving=True))
    for sample in samples:
        sampler.push(sample)
        mpc.push(sample)
    mpc.clock(samples[-1].stamp)
    n = mpc.controller.steps
    mpc.solve_outside(np.zeros(n), np.empty(n), np.empty((n, 2)))


def _drawings() -> None:
    """What a report draws and an evaluation's detectors count."""
    settings = graph_settings("paper").diagnosis
    n = settings.prediction_steps
    store = PredictionStore(n)
    store.follow(first_horizon().record)
    store.push(np.zeros((n, 2)))
    PredictionLimits(settings).outside(np.zeros(2), store.for_now())
    confidences(np.zeros(1), 0.5, 10)


def main_compile(arguments: list[str]) -> int:
    """The command line of `compile_all`."""
    argparse.ArgumentParser(prog="compile_all", description=__doc__).parse_args(arguments)
    if (cache_folder() / COMPLETE).is_file():
        return 0
    print("compile: the algorithm, once after a change (a minute or two)", flush=True)
    started = time.perf_counter()
    # The robust profile takes two thirds of the time, all else the rest.
    with workers(2) as pool:
        parts = [pool.submit(_profile, name) for name in PROFILES]
        parts.append(pool.submit(_outside_a_profile))
        for part in parts:
            part.result()
    # Fetches what they have kept; what one of them lost to the other is made now.
    compile_all()
    print(f"compile: done in {time.perf_counter() - started:.0f} s, kept in {cache_folder()}")
    return 0


def main() -> int:
    """Entry point of `lfd_bringup compile_all`."""
    return run_command(main_compile)
