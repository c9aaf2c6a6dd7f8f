"""Builds the message packages of recorded cars, which are not installed, for tests."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from lfd_replay.recordings.message_definitions import DEFINITIONS

PACKAGES = {
    "can_msgs": ["std_msgs"],
    "delphi_esr_msgs": ["std_msgs"],
    "radar_msgs": ["std_msgs", "geometry_msgs", "unique_identifier_msgs"],
}
"""Packages and what their messages are made of."""

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name><version>0.0.0</version><description>For tests.</description>
  <maintainer email="lfd@example.com">lfd</maintainer><license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <build_depend>rosidl_default_generators</build_depend>
  {depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""

CMAKE = """cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{find}
rosidl_generate_interfaces({name} {files} DEPENDENCIES {depends})
ament_package()
"""


def build(folder: Path) -> Path:
    """Build the packages below a folder; returns the script to source."""
    for name, depends in PACKAGES.items():
        package = folder / "src" / name
        (package / "msg").mkdir(parents=True)
        files = []
        for full, text in DEFINITIONS.items():
            if full.startswith(f"{name}/"):
                file = package / "msg" / f"{full.rsplit('/', 1)[-1]}.msg"
                file.write_text(text)
                files.append(f"msg/{file.name}")
        manifest = MANIFEST.format(
            name=name, depends="".join(f"<depend>{d}</depend>" for d in depends)
        )
        (package / "package.xml").write_text(manifest)
        (package / "CMakeLists.txt").write_text(
            CMAKE.format(
                name=name,
                find="\n".join(f"find_package({d} REQUIRED)" for d in depends),
                files=" ".join(f'"{file}"' for file in files),
                depends=" ".join(depends),
            )
        )
    environment = {**os.environ, "MAKEFLAGS": "-j4"}
    environment["CMAKE_PREFIX_PATH"] = environment["AMENT_PREFIX_PATH"]
    command = [sys.executable, "-m", "colcon", "build", "--merge-install", "--cmake-args"]
    command += ["-G", "Ninja"] if shutil.which("ninja") else []
    command += [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder / "install" / "local_setup.bash"
