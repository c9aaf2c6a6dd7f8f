"""Compile everything that is compiled once after installation, so that no node has to.

Without it the first start of a node after installation or a change of the sources takes longer.
"""

import shutil
import sys
import time

from lfd_mpc.compiled import CACHE_FOLDER
from lfd_replay.generated.generate import generate_drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, graph_settings

COMPLETE = CACHE_FOLDER / "complete"
"""Is there once everything has been compiled."""

SAMPLES = 400
"""Samples of a drive that call every compiled function."""


def compile_all() -> None:
    """Call every compiled function once, and remove what was compiled from other sources."""
    samples = generate_drive("data-1", 0, "esr").samples[:SAMPLES]
    for profile in PROFILES:
        settings = graph_settings(profile)
        for _ in OfflineGraph(settings).run(samples):
            pass
        for _ in OfflineGraph(settings).rows(samples):
            pass
    if CACHE_FOLDER.is_dir():
        for other in CACHE_FOLDER.parent.glob("compiled-*"):
            if other != CACHE_FOLDER:
                shutil.rmtree(other, ignore_errors=True)
        COMPLETE.touch()


def main() -> int:
    """Entry point of `lfd_replay compile_all`."""
    if COMPLETE.is_file():
        return 0
    print("compile: the algorithm, once after a change (a minute)", flush=True)
    started = time.perf_counter()
    compile_all()
    print(f"compile: done in {time.perf_counter() - started:.0f} s, kept in {CACHE_FOLDER}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
