"""What the packages say of themselves: dependencies, descriptions, requirements."""

import ast
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob("ros2_ws/src/*/package.xml"))
PYTHON_PACKAGES = [folder for folder in PACKAGES if (folder / "setup.py").is_file()]

KEYS = {
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "pydantic": "python3-pydantic",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
}
"""Python libraries that rosdep knows on Ubuntu 24.04. It knows none of the others there, and stops
at a key that it does not know: those come from the requirements alone."""

REQUIREMENTS = {
    "can": "python-can",
    "vehiclemodels": "commonroad-vehicle-models",
    "yaml": "PyYAML",
}
"""What is required for an import, where that has another name."""

COMMANDS = {"lfd_bringup": {"ros2bag", "rosbag2_storage_mcap"}}
"""What a package runs instead of importing it: `ros2 bag record` of the launch file."""


def imports(files: Iterable[Path]) -> set[str]:
    """The libraries that files import, also inside functions, without Python's own."""
    found = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                found.update(name.name.partition(".")[0] for name in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module.partition(".")[0])
    return found - sys.stdlib_module_names


def sources(folder: Path) -> list[Path]:
    """The Python files that run: all but what installs them."""
    return [file for file in folder.rglob("*.py") if file.name != "setup.py"]


def required() -> set[str]:
    """The names in all requirement files, each of which is pinned."""
    names = set()
    for file in ROOT.glob("requirements*.txt"):
        for line in file.read_text().splitlines():
            if not line.startswith("#"):
                pinned = re.match(r"([\w.-]+)(\[\w+\])?==\d", line)
                assert pinned, f"{file.name}: not pinned: {line}"
                names.add(pinned[1])
    return names


@pytest.mark.parametrize("folder", PYTHON_PACKAGES, ids=lambda folder: folder.name)
def test_what_is_imported_is_declared_and_nothing_else_is(folder: Path) -> None:
    ros = {path.name for path in PACKAGES} | {"launch", "launch_ros", "rclpy", "ament_index_python"}
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    declared = [element.text for element in manifest if element.tag.endswith("depend")]
    assert len(declared) == len(set(declared))
    needed = set(COMMANDS.get(folder.name, ()))
    for name in imports(sources(folder)) - {folder.name}:
        if name in ros or name.endswith(("_msgs", "_srvs", "_interfaces")):
            needed.add(name)
        elif name in KEYS:
            needed.add(KEYS[name])
        else:
            assert REQUIREMENTS.get(name, name) in required(), name
    assert set(declared) == needed


def test_what_the_messages_are_made_of_is_declared() -> None:
    folder = ROOT / "ros2_ws/src/lfd_msgs"
    interfaces = sorted([*folder.glob("msg/*.msg"), *folder.glob("srv/*.srv")])
    used = {
        match[1]
        for file in interfaces
        for match in re.finditer(r"^(\w+)/\w+", file.read_text(), re.MULTILINE)
    }
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    assert used == {element.text for element in manifest.findall("depend")}
    built = (folder / "CMakeLists.txt").read_text()
    assert {str(file.relative_to(folder)) for file in interfaces} == set(
        re.findall(r'"(\w+/\w+\.(?:msg|srv))"', built)
    )


@pytest.mark.parametrize("folder", PYTHON_PACKAGES, ids=lambda folder: folder.name)
def test_manifest_and_setup_say_the_same(folder: Path) -> None:
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    (call,) = (
        node
        for node in ast.walk(ast.parse((folder / "setup.py").read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "setup"
    )
    said = {word.arg: word.value for word in call.keywords}
    for name in ("name", "version", "description", "maintainer", "license"):
        assert ast.literal_eval(said[name]) == manifest.findtext(name), name
    email = manifest.find("maintainer").attrib["email"]
    assert ast.literal_eval(said["maintainer_email"]) == email


def test_every_library_that_is_imported_is_required() -> None:
    ours = {path.name for path in PACKAGES}
    ours |= {
        file.stem for folder in ("tests", "benchmarks") for file in (ROOT / folder).glob("*.py")
    }
    folders = (ROOT / "ros2_ws/src", ROOT / "tests", ROOT / "benchmarks", ROOT / "tools")
    libraries = {
        REQUIREMENTS.get(name, name)
        for name in imports(file for folder in folders for file in sources(folder)) - ours
        if not name.endswith(("_msgs", "_srvs", "_interfaces"))
    }
    # ROS itself: launch_ros is nowhere in the wheels, rclpy is there under another name.
    assert libraries - {"ament_index_python", "launch", "launch_ros", "rclpy"} <= required()
