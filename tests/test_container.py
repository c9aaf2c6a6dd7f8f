"""Setting up, and the image on plain Debian, which is built and run where buildah is."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
DOCKER = ROOT / "docker"
BUILD = {**os.environ, "STORAGE_DRIVER": "vfs", "BUILDAH_ISOLATION": "chroot"}


def run(*command: object, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [str(word) for word in command], env=BUILD, capture_output=True, text=True, **options
    )


def test_services_share_network_memory_and_user_and_may_write_nothing() -> None:
    services = yaml.safe_load((DOCKER / "compose.yaml").read_text())["services"]
    assert set(services) == {
        *("mpc_node", "observer_node", "diagnosis_node", "decision_node"),
        "replay",
    }
    for name, service in services.items():
        assert service["user"] == "1000:1000" and service["read_only"], name
        assert service["tmpfs"] == ["/tmp"] and service["cap_drop"] == ["ALL"], name
        if name != "mpc_node":
            assert service["ipc"] == service["network_mode"] == "service:mpc_node"
        if name != "replay":
            assert name in service["healthcheck"]["test"]
    assert services["mpc_node"]["ipc"] == "shareable"


def test_both_images_share_their_build_script() -> None:
    for name in ("Dockerfile.ros", "Dockerfile.wheels"):
        text = (DOCKER / name).read_text()
        assert "RUN bash /opt/lfd/docker/build.sh" in text and "USER 1000:1000" in text


def test_a_step_of_the_setup_that_fails_while_it_clears_the_environment_is_told(
    tmp_path: Path,
) -> None:
    (tmp_path / "tools").mkdir()
    setup = shutil.copy(ROOT / "tools" / "setup.py", tmp_path / "tools")
    for file in ROOT.glob("requirements*.txt"):
        shutil.copy(file, tmp_path)
    (tmp_path / ".venv").mkdir()
    (tmp_path / "venv.py").write_text(
        "import shutil, sys\n"
        "if __name__ == '__main__':\n"
        "    shutil.rmtree(sys.argv[-1])\n"
        "    sys.exit('no room for it')\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, setup], env=environment, capture_output=True, text=True)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "no room for it" in done.stderr and "check that python3 -m venv works" in done.stderr
    assert "no room for it" in (tmp_path / "out" / "setup.log").read_text()


@pytest.mark.alone
@pytest.mark.skipif(os.environ.get("LFD_SOAK") != "1", reason="a part of `make soak`: NOT RUN here")
def test_the_image_is_built_and_replays_without_root(tmp_path: Path, capfd) -> None:
    if os.getuid() or not all(map(shutil.which, ("buildah", "debootstrap"))):
        pytest.skip("needs root, buildah and debootstrap: NOT RUN here")
    made = run("bash", DOCKER / "base.sh", tmp_path / "base")
    assert made.returncode == 0, made.stderr[-2000:]
    built = run("buildah", "build", "-f", DOCKER / "Dockerfile.wheels", "-t", "lfd:wheels", ROOT)
    assert built.returncode == 0, built.stdout[-2000:] + built.stderr[-2000:]
    container = run("buildah", "from", "lfd:wheels").stdout.strip()
    try:
        replay = "lfd_bringup replay --rate 0 --duration 5 --out /tmp/out"
        inside = f"bash /opt/lfd/docker/entrypoint.sh {replay}"
        script = f"id -u; touch /opt/lfd/x 2>&1; {inside} && ls /tmp/out"
        done = run("buildah", "run", container, "--", "bash", "-c", script)
        with capfd.disabled():
            print("\n  " + "\n  ".join(done.stdout.strip().splitlines()[-3:]))
        checked = run(
            *("buildah", "run", container, "--", "bash", "-c"),
            "export ROS_DOMAIN_ID=77; bash /opt/lfd/docker/health.sh mpc_node; echo $?; "
            "bash /opt/lfd/docker/entrypoint.sh lfd_mpc mpc_node & node=$!; sleep 5; "
            "bash /opt/lfd/docker/health.sh mpc_node; echo $?; kill -INT $node; wait $node",
        )
        statuses = [line for line in checked.stdout.splitlines() if line in "01"]
        assert statuses == ["1", "0"], checked.stdout
        lines = done.stdout.splitlines()
        assert done.returncode == 0, done.stderr
        assert lines[0] == "1000" and "Permission denied" in lines[1]
        assert "report.html" in done.stdout
    finally:
        run("buildah", "rm", container)
