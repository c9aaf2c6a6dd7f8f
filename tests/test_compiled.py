"""What was compiled is kept until anything changes that was compiled in."""

import ast
import importlib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from test_packages import REQUIREMENTS, imports

from lfd_mpc import compiled
from lfd_mpc.compiled import LIBRARIES, NOT_COMPILED, PACKAGES, WITH_FEW, compiled_sources

SOURCES = Path(__file__).parent.parent / "ros2_ws/src"
OUTSIDE = {"pydantic", "proxsuite", "qpsolvers"}
"""Libraries that check settings and solve problems outside of compiled code."""

COMPILING = {"entry", "inner", "borrowing"}
"""What compiles a function."""


def digest() -> str:
    return compiled._sources_digest()


@pytest.fixture
def probe(tmp_path: Path, monkeypatch) -> Path:
    """The folder of a package that takes the place of all that are compiled."""
    folder = tmp_path / "probed"
    folder.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compiled, "PACKAGES", ("probed",))
    importlib.invalidate_caches()
    return folder


def changes(file: Path, text: str) -> bool:
    """Whether the key is another one once a file has such a text."""
    before = digest()
    file.write_text(text)
    return digest() != before


def test_another_source_is_compiled_anew(probe: Path) -> None:
    assert changes(probe / "formula.py", "A = 1")
    assert not changes(probe / "formula.py", "A = 1")
    assert changes(probe / "formula.py", "A = 2")
    assert not changes(probe / "driving.py", "A = 1"), "nothing compiled is in it"
    assert changes(probe / "normal_driving.py", "A = 1"), "its name only ends like that one"


def test_of_packages_with_few_compiled_functions_only_their_files_count(
    probe: Path, monkeypatch
) -> None:
    monkeypatch.setattr(compiled, "WITH_FEW", ("probed",))
    assert not changes(probe / "tables.py", "A = 1")
    assert changes(probe / "model.py", "from lfd_mpc.compiled import inner")


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_of_a_library_is_compiled_anew(library: str, monkeypatch) -> None:
    """The vehicle stayed the one of the version with which it had been compiled."""
    before = digest()
    monkeypatch.setattr(compiled, "version", lambda name: "0" if name == library else version(name))
    assert digest() != before


def test_a_machine_without_the_vehicle_s_library_has_a_key(monkeypatch) -> None:
    monkeypatch.setattr(compiled, "LIBRARIES", (*LIBRARIES, "no-such-library"))
    assert digest()


def test_every_library_that_is_compiled_in_is_named() -> None:
    there = {name for name in imports(compiled_sources()) if name not in PACKAGES}
    named = {REQUIREMENTS.get(name, name) for name in there - OUTSIDE}
    assert named <= {*LIBRARIES}


def test_each_name_is_that_of_a_file_and_needed() -> None:
    of_whole_packages = (folder for folder in PACKAGES if folder not in WITH_FEW)
    there = {file.name for name in of_whole_packages for file in (SOURCES / name / name).iterdir()}
    assert there >= NOT_COMPILED


class Module:
    """What a file of the project takes from others of its files, and what it compiles."""

    def __init__(self, name: str, file: Path) -> None:
        self.name, self.file = name, file
        self.tree = ast.parse(file.read_text())
        self.taken = {
            (alias.asname or alias.name): (node.module, alias.name)
            for node in ast.walk(self.tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }

    def compiled_in(self) -> Iterator[str]:
        """Names in compiled functions, and in values of the module that these may take."""
        for node in self.tree.body:
            if isinstance(node, ast.FunctionDef):
                made = {name.id for name in node.decorator_list if isinstance(name, ast.Name)}
                parts = [*node.body] if made & COMPILING else []
            else:
                parts = [node] if isinstance(node, ast.Assign | ast.AnnAssign) else []
            for part in parts:
                yield from (n.id for n in ast.walk(part) if isinstance(n, ast.Name))


def test_no_compiled_function_takes_anything_from_a_file_that_does_not_count() -> None:
    """A change there would leave what was compiled as it is."""
    modules = {}
    for package in PACKAGES:
        for file in (SOURCES / package / package).rglob("*.py"):
            name = ".".join(file.relative_to(SOURCES / package).with_suffix("").parts)
            modules[name] = Module(name, file)

    def home(module: str, name: str) -> str:
        """The module that defines what another one gives on."""
        while module in modules and name in modules[module].taken:
            module, name = modules[module].taken[name]
        return module

    counting = {file.resolve() for file in compiled_sources()}
    counts = {name for name, module in modules.items() if module.file.resolve() in counting}
    assert "lfd_mpc.horizon" in counts and "lfd_vehicle.library_model" in counts
    wrong = {
        f"{module.name}: {name} of {source}"
        for module in modules.values()
        for name in (module.compiled_in() if module.name in counts else ())
        if (source := home(module.name, name)) in modules and source not in counts
    }
    assert not wrong
    compiling = {
        name
        for name, module in modules.items()
        if any(
            source == "lfd_mpc.compiled" and what in COMPILING
            for source, what in module.taken.values()
        )
    }
    assert compiling <= counts
