"""Set the project up inside its own clone: environment, ROS 2, workspace.

Needs nothing but Python 3.10 to 3.13 with venv and headers, and a C/C++ compiler. What is done
already is skipped: each step leaves a stamp made of all that it depends on.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
WORKSPACE = ROOT / "ros2_ws"
LOG = ROOT / "out" / "setup.log"
"""Not in the environment, which is cleared by a step whose failure has to be told."""

ROS_PREFIX = (
    os.environ.get("AMENT_PREFIX_PATH") if os.environ.get("ROS_DISTRO") == "jazzy" else None
)
"""Where an installed and sourced ROS 2 Jazzy is; None: it comes as wheels."""

PIP = ("--disable-pip-version-check", "--no-compile")
"""It would make all bytecode before it ends; `bytecode` does beside the next steps."""


def fail(step: str, problem: str, remedy: str) -> None:
    """End with one line that says which step failed and what to do."""
    print(f"setup: {step}: {problem}; {remedy}", file=sys.stderr)
    sys.exit(1)


def check_prerequisites() -> None:
    """Name everything that is missing in one line."""
    missing = []
    if not (3, 10) <= sys.version_info[:2] <= (3, 13):
        missing.append(f"Python 3.10 to 3.13 (this is {sys.version.split()[0]}; set PYTHON=...)")
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        missing.append("Python's venv module (Debian and Ubuntu: python3-venv)")
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        missing.append("Python's headers (Debian and Ubuntu: python3-dev)")
    for compiler, names in (("C", ("cc", "gcc", "clang")), ("C++", ("c++", "g++", "clang++"))):
        if not any(map(shutil.which, names)):
            missing.append(f"a {compiler} compiler (Debian and Ubuntu: build-essential)")
    if missing:
        print(f"setup: missing: {'; '.join(missing)}", file=sys.stderr)
        sys.exit(1)


def run(step: str, remedy: str, command: list, **options) -> None:
    """Run one command with its output in the log; on failure show the end of it."""
    LOG.parent.mkdir(exist_ok=True)
    with LOG.open("a") as log:
        log.write(f"$ {' '.join(map(str, command))}\n")
        log.flush()
        done = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, **options)
    if done.returncode:
        tail = LOG.read_text(errors="replace").splitlines()[-25:]
        print("\n".join(tail), file=sys.stderr)
        fail(step, f"exit status {done.returncode} (whole output in {LOG})", remedy)


def stamp(name: str, parts: list[bytes]) -> tuple[Path, str]:
    """The stamp file of a step and what must stand in it for the step to be done."""
    digest = hashlib.sha256(b"\0".join([os.fsencode(ROOT), *parts])).hexdigest()
    return VENV / f"{name}.stamp", digest


def needed(file: Path, digest: str) -> bool:
    """Whether the step has to run."""
    return not file.is_file() or file.read_text() != digest


def make_environment() -> bool:
    """A virtual environment with the pinned requirements; true if anything was installed."""
    files = [ROOT / "requirements.txt", ROOT / "requirements-dask.txt"]
    if ROS_PREFIX is None:
        files.insert(0, ROOT / "requirements-ros.txt")
    file, digest = stamp(
        "environment",
        [sys.version.encode(), str(ROS_PREFIX).encode(), *(f.read_bytes() for f in files)],
    )
    if not needed(file, digest):
        return False
    print(f"setup: environment in {VENV} (a minute or two)", flush=True)
    options = ["--clear"] + (["--system-site-packages"] if ROS_PREFIX else [])
    run(
        "environment",
        "check that python3 -m venv works",
        [sys.executable, "-m", "venv", *options, VENV],
    )
    arguments = [word for f in files for word in ("-r", str(f))]
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as constraints:
        if ROS_PREFIX:
            # The installed messages are compiled against the installed numpy.
            import numpy

            constraints.write(f"numpy=={numpy.__version__}\n")
            constraints.flush()
            arguments += ["-c", constraints.name]
        run(
            "environment",
            "check the connection to the package index and run the command again",
            [PYTHON, "-m", "pip", "install", *PIP, *arguments],
        )
    if ROS_PREFIX is None:
        mend_wheels()
    file.write_text(digest)
    return True


def mend_wheels() -> None:
    """Replace the paths of the machine that built the wheels, which stop CMake."""
    include = sysconfig.get_path("include")
    numpy = subprocess.run(
        [PYTHON, "-c", "import numpy; print(numpy.get_include())"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    tag = f"{sys.version_info.major}.{sys.version_info.minor}"
    build = f"/opt/python/cp{tag.replace('.', '')}-cp{tag.replace('.', '')}"
    replaced = {
        f"{build}/include/python{tag}": include,
        f"{build}/lib/python{tag}/site-packages/numpy/_core/include": numpy,
    }
    for file in VENV.glob("share/*/cmake/*.cmake"):
        text = old = file.read_text()
        for wrong, right in replaced.items():
            text = text.replace(wrong, right)
        if text != old:
            file.write_text(text)


@contextmanager
def bytecode(environment_is_new: bool) -> Iterator[None]:
    """Leave that of all libraries: a node may be started where none can be kept."""
    making = None
    if environment_is_new:
        # What cannot be compiled, a template say, is never loaded either.
        making = subprocess.Popen(
            ["nice", "-n", "19", PYTHON, "-m", "compileall", "-qq", VENV / "lib"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    try:
        yield
    finally:
        if making is not None:
            making.wait()


def build_workspace(environment_is_new: bool) -> None:
    """`colcon build` with symbolic links, so that an edit of Python code needs no rebuild."""
    sources = sorted(
        path
        for path in (WORKSPACE / "src").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and ".egg-info" not in str(path)
    )
    built = {".msg", ".xml", ".cfg", ".txt", ".srv"}
    parts = [(VENV / "environment.stamp").read_bytes()]
    for path in sources:
        parts.append(os.fsencode(path))
        if path.suffix in built or path.name == "setup.py":
            parts.append(path.read_bytes())
    file, digest = stamp("workspace", parts)
    installed = WORKSPACE / "install" / "local_setup.bash"
    if not environment_is_new and installed.is_file() and not needed(file, digest):
        return
    print("setup: building the workspace (a minute)", flush=True)
    if environment_is_new:
        for folder in ("build", "install", "log"):
            shutil.rmtree(WORKSPACE / folder, ignore_errors=True)
    environment = {**os.environ, "MAKEFLAGS": "-j4"}
    environment["PATH"] = f"{VENV / 'bin'}:{environment['PATH']}"
    if ROS_PREFIX is None:
        environment["AMENT_PREFIX_PATH"] = environment["CMAKE_PREFIX_PATH"] = str(VENV)
    command = [PYTHON, "-m", "colcon", "build", "--symlink-install", "--cmake-args"]
    if shutil.which("ninja", path=environment["PATH"]):
        command += ["-G", "Ninja"]
    command += [f"-DPython3_EXECUTABLE={PYTHON}", "-DBUILD_TESTING=OFF"]
    run(
        "workspace",
        "mend what the lines above complain of and run the command again",
        command,
        cwd=WORKSPACE,
        env=environment,
    )
    file.write_text(digest)


@contextmanager
def compiled() -> Iterator[None]:
    """Compile what is compiled once after installation or a change of the algorithm, meanwhile."""
    packages = sorted((WORKSPACE / "src").glob("lfd_*/lfd_*"))
    sources = sorted(path for package in packages for path in package.glob("*.py"))
    environment_stamp = (VENV / "environment.stamp").read_bytes()
    parts = [environment_stamp, *(path.read_bytes() for path in sources)]
    file, digest = stamp("compiled", parts)
    if not needed(file, digest):
        yield
        return
    # The workspace may not be built yet; nothing that is compiled needs its messages.
    environment = {**os.environ, "PYTHONPATH": ":".join(str(p.parent) for p in packages)}
    command = "import sys; from lfd_bringup.compile_all import main; sys.exit(main())"
    making = subprocess.Popen([PYTHON, "-c", command], env=environment)
    try:
        yield
        if making.wait():
            fail("compile", "the algorithm was not compiled", "see the lines above")
    finally:
        making.terminate()
        making.wait()
    # Nodes may be started where no bytecode can be kept: by another user, in a read-only image.
    folders = [*packages, WORKSPACE / "install" / "lfd_msgs"]
    run("compile", "see the lines above", [PYTHON, "-m", "compileall", "-q", *folders])
    file.write_text(digest)


def main() -> None:
    """Carry out what is not done yet."""
    check_prerequisites()
    is_new = make_environment()
    with bytecode(is_new), compiled():
        build_workspace(is_new)


if __name__ == "__main__":
    main()
