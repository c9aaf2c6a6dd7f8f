"""Compiled functions: the algorithm's formulas, each written once as a plain function.

State lives in numpy records (`numpy.dtype` with named fields); a function takes the record that it
changes as its first argument, as a method would. Functions that are called from outside take arrays
of one record. Nodes, which take one step at a time, and evaluations, which take a drive at once,
call the same functions.

What was compiled is kept on disk until a source file of the algorithm changes, or a library whose
functions and constants are compiled in. `LFD_CACHE` names the folder; without it, it is in the
package, or in the user's cache where that cannot be written.
"""

import hashlib
import os
import sys
from collections import namedtuple
from collections.abc import Callable, Iterator
from functools import cache, cached_property, partial, update_wrapper
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.collector import without_collector

HIDDEN = ("coverage", "scipy.linalg.cython_blas")
"""Serve numba for coverage of compiled code and for matrix products: neither is used."""


@cache
def _numba() -> ModuleType:
    """What compiles, loaded when it is needed first: half of what a node loads is this.

    Without `HIDDEN` and the search for garbage that takes half as long.
    """
    hidden = [name for name in HIDDEN if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    with without_collector(stays=True):
        try:
            import numba
            import numba.np.arraymath
        finally:
            for name in hidden:
                del sys.modules[name]
    return numba


PACKAGES = ("lfd_mpc", "lfd_observer", "lfd_diagnosis", "lfd_replay", "lfd_vehicle")
"""Packages whose functions call each other; a change in one of them counts for all."""

LIBRARIES = ("numba", "numpy", "commonroad-vehicle-models")
"""Whose functions and constants are compiled in; another version of one counts for all, too."""

NOT_COMPILED = frozenset(
    {
        "__init__.py",
        "collector.py",
        "deadline.py",
        "decision.py",
        "decision_node.py",
        "diagnosis_node.py",
        "driving.py",
        "errors.py",
        "executables.py",
        "fault_level.py",
        "following_model.py",
        "health.py",
        "markers.py",
        "messages.py",
        "mpc_node.py",
        "node_process.py",
        "node_support.py",
        "observer_node.py",
        "pairing.py",
        "qos_events.py",
        "reasons.py",
        "sensor_health.py",
        "sensor_inputs.py",
        "silence.py",
        "starting.py",
    }
)
"""Names of files that nothing compiled depends on: no compiled function takes a value from them."""

WITH_FEW = ("lfd_replay", "lfd_vehicle")
"""Packages of which only files that compile something themselves count."""

Function = TypeVar("Function", bound=Callable)


def compiled_sources() -> Iterator[Path]:
    """The files that what is compiled is made of, in an order that stays."""
    for package in PACKAGES:
        spec = find_spec(package)
        for folder in spec.submodule_search_locations or () if spec else ():
            for file in sorted(Path(folder).glob("*.py")):
                counts = package not in WITH_FEW or b"lfd_mpc.compiled" in file.read_bytes()
                if counts and file.name not in NOT_COMPILED:
                    yield file


def _installed(library: str) -> str:
    """A library's version; a machine that only judges may do without the vehicle's."""
    try:
        return version(library)
    except PackageNotFoundError:
        return "none"


def _sources_digest() -> str:
    """Stands for all that is compiled, and for what compiles it."""
    libraries = " ".join(f"{library} {_installed(library)}" for library in LIBRARIES)
    digest = hashlib.sha256(libraries.encode())
    for file in compiled_sources():
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


@cache
def cache_folder() -> Path:
    """Where compiled functions are kept, by source."""
    chosen = os.environ.get("LFD_CACHE")
    own = Path(__file__).resolve().parent / "__pycache__"
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lfd"
    base = Path(chosen) if chosen else own if _writable(own) else user
    return base / f"compiled-{_sources_digest()}"


class Compiled:
    """A function that is compiled, or fetched from disk, when it is called first.

    A node imports its algorithm at once and listens; what comes while this is loaded waits.
    """

    def __init__(self, function: Callable, *, kept: bool = False, counts: bool = True) -> None:
        """`kept`: the result is kept on disk, with all functions that it calls; `counts`: it counts
        who refers to its arrays."""
        update_wrapper(self, function)
        self.kept, self.counts = kept, counts

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it, compiled for the types that it has been called with."""
        numba = _numba()
        if not self.kept:
            # What lets Python call it takes a seventh of the time to compile.
            bare = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
            return numba.njit(error_model="numpy", _nrt=self.counts, **bare)(self.__wrapped__)
        # It is kept by its file's path, and a workspace of links reaches a file by more than one.
        code = self.__wrapped__.__code__
        self.__wrapped__.__code__ = code.replace(co_filename=os.path.realpath(code.co_filename))
        config, folder = numba.core.config, cache_folder()
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return numba.njit(error_model="numpy", cache=_writable(folder))(self.__wrapped__)
        finally:
            config.CACHE_DIR = before

    @cached_property
    def _called(self) -> Any:
        """What Python calls: tests call inner functions, too."""
        if self.kept:
            return self.dispatcher
        return _numba().njit(error_model="numpy", _nrt=self.counts)(self.__wrapped__)

    @property
    def _numba_type_(self) -> Any:
        """As what other compiled functions call it."""
        return _numba().typeof(self.dispatcher)

    def __call__(self, *arguments: Any) -> Any:
        return self._called(*arguments)


def inner(function: Function) -> Function:
    """Compile a function that only compiled functions call."""
    return cast(Function, Compiled(function))


def borrowing(function: Function) -> Function:
    """Compile a function as `inner`, which only borrows its arrays: it makes none, copies no slice
    into another, and returns none.

    Counting who refers to the arrays of a model took a third of a step in the loop.
    """
    return cast(Function, Compiled(function, counts=False))


def entry(function: Function) -> Function:
    """Compile a function that is called from outside, and keep the result on disk."""
    return cast(Function, Compiled(function, kept=True))


def make_state(kind: np.dtype) -> NDArray[np.void]:
    """A record of zeros as an array of one, for functions to change in place.

    Compiled functions are called with such arrays: the type of an array is found by its dtype's
    identity, that of a record by walking through all of its fields at every call.
    """
    return np.zeros(1, kind)


def unpacker(kind: np.dtype) -> Callable[[np.void], Any]:
    """A function that gives a record's values as nested named tuples of plain Python values.

    Much faster to read than the record itself; fields that are arrays stay arrays.
    """
    build = _from_tuple(kind)
    return lambda record: build(record.item())


def _from_tuple(kind: np.dtype) -> Callable[[tuple], Any]:
    made = namedtuple("Values", kind.names or ())  # type: ignore[misc]
    nested = [
        (number, _from_tuple(kind[number]))
        for number in range(len(kind))
        if kind[number].names is not None
    ]
    # As `made._make` does, without its check of a length that the dtype settles.
    make = partial(tuple.__new__, made)
    if not nested:
        return make

    def build(values: tuple) -> Any:
        filled = list(values)
        for number, convert in nested:
            filled[number] = convert(filled[number])
        return make(filled)

    return build
