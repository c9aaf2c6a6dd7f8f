"""Profiles and parameter files: the settings of all nodes."""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import yaml
from pydantic import ValidationError

from lfd_diagnosis.settings import DecisionSettings, DiagnosisSettings
from lfd_mpc.errors import UserError
from lfd_mpc.settings import MpcSettings, Settings, as_meant, settings_error, unknown_parameter
from lfd_observer.settings import BankSettings

PROFILES: dict[str, dict[str, dict[str, object]]] = {
    "robust": {},
    "paper": {"observer_node": {"restart_error": 0.0}, "diagnosis_node": {"profile": "paper"}},
}
"""What `--profile` accepts; the first is the default: the settings' own defaults are the robust
profile, the others say in what they differ."""

DEFAULT_PROFILE = next(iter(PROFILES))


@dataclass(frozen=True)
class GraphSettings:
    """Settings of the whole graph."""

    mpc: MpcSettings
    bank: BankSettings
    diagnosis: DiagnosisSettings
    decision: DecisionSettings = DecisionSettings()

    @property
    def profile(self) -> str:
        """The profile that judges: a parameter file's own takes precedence over what was asked."""
        return self.diagnosis.profile


NODES: dict[str, type[Settings]] = {
    "mpc_node": MpcSettings,
    "observer_node": BankSettings,
    "diagnosis_node": DiagnosisSettings,
    "decision_node": DecisionSettings,
}
"""The settings of each node of the graph, by node name."""

NODES_IN_WORDS = ", ".join(("/**", *NODES))
"""What a parameter file may name."""


def known_profile(name: str) -> str:
    """The name of a profile as it was given. Raises UserError for an unknown one."""
    if name not in PROFILES:
        raise UserError(f"--profile {name}: unknown; there are: {', '.join(PROFILES)}")
    return name


def graph_settings(profile: str, file: Path | None = None) -> GraphSettings:
    """Settings of a profile, changed by a ROS parameter file.

    Raises UserError for an unknown profile, an unreadable file, or a refused or unknown parameter.
    """
    known_profile(profile)
    values = {name: {} for name in NODES} if file is None else read_parameter_file(file)
    built = {}
    for name, kind in NODES.items():
        try:
            built[name] = kind(**{**PROFILES[profile].get(name, {}), **values[name]})
        except ValidationError as error:
            raise UserError(f"{file}: {name}: {settings_error(error)}") from error
    return GraphSettings(*built.values())  # type: ignore[arg-type]


def read_parameter_file(file: Path) -> dict[str, dict]:
    """Parameters by node name; `/**` and `/*` hold for every node that knows them.

    A node's name may have a namespace before it, as `/car/mpc_node` or `/**/mpc_node`. A file may
    be that of a whole car: other nodes are passed over, but not one that is spelt nearly right, nor
    a file of nothing but others.
    Raises UserError for an unreadable file and for unknown nodes or parameters.
    """
    try:
        content = yaml.safe_load(file.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        detail = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise UserError(f"{file}: cannot be read as a parameter file ({detail[:200]})") from error
    if not isinstance(content, dict):
        raise UserError(
            f"{file}: is no parameter file; node names with ros__parameters are expected"
        )
    values: dict[str, dict] = {name: {} for name in NODES}
    ours = False
    for key, section in content.items():
        node = str(key).rsplit("/", 1)[-1]
        if not isinstance(section, dict) or not isinstance(section.get("ros__parameters"), dict):
            raise UserError(f"{file}: '{key}' has no ros__parameters")
        if node in ("**", "*"):
            owners = list(NODES)
        elif node in NODES:
            owners = [node]
        elif get_close_matches(node, NODES, cutoff=0.8):
            raise UserError(f"{file}: unknown node '{key}'; there are: {NODES_IN_WORDS}")
        else:
            continue
        ours = True
        _take(file, section["ros__parameters"], owners, values)
    if not ours:
        raise UserError(f"{file}: names no node of the graph; there are: {NODES_IN_WORDS}")
    return values


def _take(file: Path, given: dict, owners: list[str], values: dict[str, dict]) -> None:
    """Put the parameters of one section into the values of those of its nodes that know them."""
    for name, value in given.items():
        knowing = [owner for owner in owners if name in NODES[owner].model_fields]
        if not knowing and name != "use_sim_time":
            known = {field for owner in owners for field in NODES[owner].model_fields}
            said = unknown_parameter(name, " and ".join(owners), known)
            raise UserError(f"{file}: {said}")
        for owner in knowing:
            values[owner][name] = as_meant(value, NODES[owner].model_fields[name].default)


def parameter_file_text(heading: Iterable[str], settings: GraphSettings) -> str:
    """A ROS parameter file with every parameter, its unit, meaning and source.

    `heading` are lines of comment at its beginning.
    """
    lines = [f"# {line}" for line in heading]
    for node, values in zip(NODES, vars(settings).values(), strict=True):
        lines += ["", f"/**/{node}:", "  ros__parameters:"]
        for name, field in type(values).model_fields.items():
            extra = field.json_schema_extra
            assert isinstance(extra, dict)
            value = getattr(values, name)
            if isinstance(value, tuple):
                value = list(value)
            text = yaml.safe_dump(value, default_flow_style=True).replace("\n...", "").strip()
            lines.append(f"    # {field.description} [{extra['unit']}]; {extra['source']}")
            lines.append(f"    {name}: {text}")
    return "\n".join(lines) + "\n"


def write_profile_files(folder: Path) -> None:
    """Write the parameter file of each profile, for `make parameters`."""
    for profile in PROFILES:
        (folder / f"{profile}.yaml").write_text(profile_file_text(profile))


def profile_file_text(profile: str) -> str:
    """The parameter file of a profile."""
    heading = (
        f"Parameters of the {profile} profile. Made by `make parameters` from the settings",
        "models, where each one is described once; a test holds them to be the same.",
    )
    return parameter_file_text(heading, graph_settings(profile))
