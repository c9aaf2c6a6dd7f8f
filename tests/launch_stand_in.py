"""Enough of `launch` and `launch_ros` to run a launch file where neither is installed.

Declared arguments, nodes, processes and what follows their end mean what they mean there; nodes
become the command lines that launch_ros makes: name and namespace as remappings, parameters as
files whose key is the node's full name.
"""

import subprocess
import sys
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str
    description: str


@dataclass
class SetEnvironmentVariable:
    name: str
    value: str


@dataclass
class OpaqueFunction:
    function: Any


@dataclass
class ExecuteProcess:
    cmd: list[str]
    output: str


@dataclass
class Node:
    package: str
    executable: str
    output: str
    name: str = ""
    namespace: str = ""
    arguments: list[str] = field(default_factory=list)
    parameters: list[str | dict] = field(default_factory=list)

    def command(self, install: Path, folder: Path) -> list[str]:
        """As launch_ros starts it, with its parameters in files in `folder`."""
        program = install / self.package / "lib" / self.package / self.executable
        made = [str(program), *self.arguments, "--ros-args"]
        namespace = f"/{self.namespace.strip('/')}" if self.namespace else ""
        made += ["-r", f"__node:={self.name}"] if self.name else []
        made += ["-r", f"__ns:={namespace}"] if namespace else []
        for number, parameters in enumerate(self.parameters):
            file = parameters
            if isinstance(parameters, dict):
                file = folder / f"{self.executable}-{number}.yaml"
                content = {f"{namespace}/{self.name}": {"ros__parameters": parameters}}
                file.write_text(yaml.safe_dump(content))
            made += ["--params-file", str(file)]
        return made


class Shutdown:
    pass


@dataclass
class EmitEvent:
    event: Shutdown


@dataclass
class OnProcessExit:
    target_action: Node
    on_exit: list[EmitEvent]


@dataclass
class RegisterEventHandler:
    event_handler: OnProcessExit


@dataclass
class LaunchDescription:
    entities: list


@dataclass
class Context:
    launch_configurations: dict[str, str]


def install(monkeypatch) -> None:
    """Have `import launch` and `import launch_ros` find these."""
    here = sys.modules[__name__]
    for name in ("launch", "launch.actions", "launch.event_handlers", "launch.events"):
        monkeypatch.setitem(sys.modules, name, here)
    for name in ("launch_ros", "launch_ros.actions"):
        module = types.ModuleType(name)
        module.Node = Node  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, name, module)


@dataclass
class Launched:
    """What a launch file started, and the environment that it asked for."""

    processes: dict[str, subprocess.Popen]
    ends_with: list[str]
    environment: dict[str, str]


def launch(
    description: LaunchDescription,
    arguments: dict[str, str],
    install: Path,
    folder: Path,
    environment: dict[str, str],
) -> Launched:
    """Start everything, as `ros2 launch FILE NAME:=VALUE...` does; output goes to `folder`."""
    chosen, actions, environment = {}, [], dict(environment)
    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            chosen[entity.name] = arguments.get(entity.name, entity.default_value)
        elif isinstance(entity, SetEnvironmentVariable):
            environment[entity.name] = entity.value
        elif isinstance(entity, OpaqueFunction):
            actions += entity.function(Context(chosen))
    assert set(arguments) <= set(chosen), "an argument that is not declared"
    processes, ends_with = {}, []
    for action in actions:
        if isinstance(action, RegisterEventHandler):
            handler = action.event_handler
            assert [type(e.event) for e in handler.on_exit] == [Shutdown]
            ends_with.append(handler.target_action.executable)
            continue
        recording = isinstance(action, ExecuteProcess)
        name = "recorder" if recording else action.executable
        command = action.cmd if recording else action.command(install, folder)
        with (folder / f"{name}.txt").open("w") as output:
            processes[name] = subprocess.Popen(command, stderr=output, env=environment)
    return Launched(processes, ends_with, environment)
