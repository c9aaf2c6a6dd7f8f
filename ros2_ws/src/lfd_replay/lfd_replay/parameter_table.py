"""docs/parameters.md: every parameter of every node, made from the settings themselves."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lfd_mpc.node_support import describe
from lfd_mpc.settings import Settings, is_fixed
from lfd_replay.adapter_settings import InjectorSettings, MountingSettings, RadarAdapterSettings
from lfd_replay.profiles import NODES

TABLES: dict[str, tuple[type[Settings], bool]] = {
    **{node: (kind, True) for node, kind in NODES.items()},
    "radar_adapter": (RadarAdapterSettings, False),
    "host_adapter": (MountingSettings, False),
    "fault_injector": (InjectorSettings, False),
}
"""Settings of each node, and whether they can be changed while it runs."""

HEADING = """# Parameters

Made by `make parameters` from the settings, where each parameter is described once; a test holds
this page to be the same. `ros2 param describe NODE NAME` says the same. A value that cannot work is
refused with the reason, at the start and while running; what can be changed while running is
applied between two steps. Changes of `profile`, `learn_noise` and the deviations to begin with make
the diagnosis judge everything anew; changes of the bank make its observers start anew.

Nodes know further parameters that are no settings of the algorithm: `receipts` (mpc_node, for
lockstep), `markers` and `marker_frame` (diagnosis_node, for RViz), `use_sim_time`, and
`qos_overrides./TOPIC.subscription.reliability` and the like on sensor inputs.
"""


Tables = Mapping[str, tuple[type[Settings], bool]]


def parameter_table(further: Tables) -> str:
    """The page, with the tables of `further` nodes at its end."""
    lines = [HEADING]
    for node, (kind, changes) in {**TABLES, **further}.items():
        lines += [f"## {node}", ""]
        lines.append("| parameter | default | unit | range | while running | what | source |")
        lines.append("|---|---|---|---|---|---|---|")
        for name, field in kind.model_fields.items():
            extra: Any = field.json_schema_extra
            running = "yes" if changes and not is_fixed(field) else "no"
            default = list(field.default) if isinstance(field.default, tuple) else field.default
            lines.append(
                f"| `{name}` | {_value(default)} | {extra['unit']} | {_range(field)} | {running} "
                f"| {field.description} | {extra['source']} |"
            )
        lines.append("")
    return "\n".join(lines)


def _value(value: Any) -> str:
    if value == "":
        return "empty"
    return f"{value:.6g}" if isinstance(value, float) else str(value).lower()


def _range(field: Any) -> str:
    descriptor = describe(field, read_only=False)
    for limits in (descriptor.floating_point_range, descriptor.integer_range):
        if limits:
            return f"{limits[0].from_value:g} to {limits[0].to_value:g}"
    return ""


def write_parameter_table(folder: Path, further: Tables) -> None:
    """Write the page into `folder`, for `make parameters`."""
    (folder / "parameters.md").write_text(parameter_table(further))
