"""simulate: the closed loop in the live node graph, with timeline, bag, report and a page to watch.

The controller drives a full vehicle model behind a lead; faults are injected into what its sensors
say, and the decision acts on the verdicts.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import rclpy
from rclpy.executors import Executor
from rclpy.node import Node
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from lfd_bringup.recorder import LOOP_TOPICS, RecorderNode
from lfd_bringup.replay import (
    GRAPH,
    LEFT,
    drain,
    event_line,
    graph_nodes,
    print_injected,
    write_bag,
)
from lfd_diagnosis.decision_node import DecisionNode
from lfd_mpc.errors import UserError
from lfd_mpc.node_process import (
    deliver,
    interruptible,
    make_executor,
    own_arguments,
    ros_started,
)
from lfd_mpc.starting import INTERRUPTED
from lfd_replay.command_line import (
    add_profile_option,
    late_faults,
    print_table,
    result_table,
    say_warnings,
)
from lfd_replay.drive_bag import refuse_others_bag
from lfd_replay.errors import run_command
from lfd_replay.faults import parse_faults
from lfd_replay.paths import make_folder, named_path, refuse_to_overwrite
from lfd_replay.player import refuse_others, settle
from lfd_replay.score import score, shown, timeline
from lfd_replay.text_file import write_text
from lfd_vehicle.lead import lead_plan
from lfd_vehicle.safety import Safety, safety_of
from lfd_vehicle.vehicle_node import LOOP_NODES, VehicleNode

WATCH_PAGE = "watch.html"
"""What a simulation leaves beside what a replay does."""

DEFAULT_LEAD = "20,-3@15-20,2@30-36"
DEFAULT_FAULT = "offset:clearance=4,relative_velocity=10@15.5-25"


def loop_nodes(
    lead: str, faults: str, profile: str, rate: float, arguments: list[str]
) -> tuple[list[Node], VehicleNode]:
    """The nodes of the closed loop in one process; `arguments` are further ROS arguments."""
    driving = ["-p", "mpc_node:driving:=true"]
    nodes = graph_nodes(profile, (*GRAPH, DecisionNode), driving)
    # Long texts would need quoting of YAML, which parameter overrides of the node do not.
    own = [
        rclpy.Parameter("lead", value=lead),
        rclpy.Parameter("faults", value=faults),
        rclpy.Parameter("rate", value=rate),
    ]
    vehicle = VehicleNode(
        parameter_overrides=own,
        wait_for=(*LOOP_NODES, "recorder"),
        cli_args=["--ros-args", *arguments],
    )
    return [*nodes, vehicle], vehicle


def _parse(arguments: list[str]) -> argparse.Namespace:
    """Raises UserError for a seed that cannot be."""
    parser = argparse.ArgumentParser(
        prog="simulate", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--lead",
        default=DEFAULT_LEAD,
        help="generated drive (data-1, braking:-6), drive file, or steps SPEED[,ACC@START-END...] "
        "(default: %(default)s)",
    )
    parser.add_argument("--fault", action="append", default=[], help="fault text; may be repeated")
    parser.add_argument("--rate", type=float, default=0.0, help="x real time; 0 = lockstep")
    parser.add_argument("--seed", type=int, default=0, help="of the sensors' noise")
    parser.add_argument(
        "--model", default="multi_body", choices=("multi_body", "point_mass"), help="of the vehicle"
    )
    add_profile_option(parser)
    parser.add_argument("--out", type=named_path, default=Path("out/simulate"), metavar="FOLDER")
    options = parser.parse_args(own_arguments("simulate", arguments))
    if options.seed < 0:
        raise UserError(f"--seed {options.seed}: 0 or more is expected")
    return options


def main_simulate(arguments: list[str]) -> int:
    """The command line of `simulate`."""
    options = _parse(arguments)
    lead_text = options.lead or DEFAULT_LEAD
    texts = [text for text in options.fault if text.strip()]
    if not texts and lead_text == DEFAULT_LEAD:
        texts = [DEFAULT_FAULT]
    faults = parse_faults(texts)
    lead = lead_plan(lead_text)
    if lead.recording is not None:
        for name in (*LEFT, WATCH_PAGE):
            refuse_to_overwrite(options.out / name, [lead.recording])
    make_folder(options.out)
    refuse_others_bag(options.out / "bag")

    console = Console(soft_wrap=True, markup=False)
    console.print(
        f"closed loop behind {lead.name}: {lead.duration:.1f} s, profile {options.profile}, "
        f"{options.model}",
        highlight=False,
    )
    print_injected(faults, console)
    say_warnings(lead.name, late_faults(faults, lead.duration))
    with ros_started(arguments):
        executor = make_executor()
        nodes: list[Node] = []
        joined = time.monotonic()
        try:
            recorder = RecorderNode(
                lambda event: console.print(event_line(event, 0), highlight=False),
                topics=LOOP_TOPICS,
            )
            nodes.append(recorder)
            # Before there is a node that another graph, or a car, would hear.
            settle(joined)
            refuse_others(recorder)
            own = ["-p", f"seed:={options.seed}", "-p", f"model:={options.model}"]
            made, vehicle = loop_nodes(
                lead_text, ";".join(texts), options.profile, options.rate, own
            )
            nodes += made
            for node in nodes:
                executor.add_node(node)
            ended = _drive(vehicle, executor, recorder, console)
            with interruptible():
                _leave(options.out, lead_text, recorder, faults, options.profile, console)
            if vehicle.status:
                return vehicle.status
        finally:
            executor.shutdown()
            for node in nodes:
                node.destroy_node()
    return 0 if ended else INTERRUPTED


def _drive(
    vehicle: VehicleNode, executor: Executor, recorder: RecorderNode, console: Console
) -> bool:
    """Run the loop and say how that went; false if it was interrupted."""
    started = time.monotonic()
    ended = _run_to_the_end(vehicle, executor, recorder, console)
    wall, driven = time.monotonic() - started, vehicle.world.stamp * 1e-9
    console.print(f"drove {driven:.1f} s in {wall:.1f} s ({driven / wall:.1f} x real time)")
    if vehicle.error is not None:
        print(vehicle.error, file=sys.stderr)
    return ended


def _run_to_the_end(
    vehicle: VehicleNode, executor: Executor, recorder: RecorderNode, console: Console
) -> bool:
    """Spin until the run is over; false if it was interrupted: what was recorded is not lost."""
    columns = (
        TextColumn("simulate"),
        BarColumn(),
        TextColumn("{task.completed:.1f} / {task.total:.1f} s"),
    )
    try:
        with Progress(
            *columns, console=console, transient=True, disable=not console.is_terminal
        ) as progress:
            task = progress.add_task("simulate", total=vehicle.total)
            while vehicle.status is None:
                deliver(executor, 0.1)
                progress.update(task, completed=vehicle.world.stamp * 1e-9)
        drain(executor, recorder)
    except KeyboardInterrupt:
        print("interrupted: what was recorded until now is written", file=sys.stderr)
        return False
    return True


def _leave(
    out: Path, lead: str, recorder: RecorderNode, faults: list, profile: str, console: Console
) -> None:
    """Bag, report, page and summary; where nothing was judged, the bag alone."""
    from lfd_replay.drawing.panels import Recording
    from lfd_replay.report import write_report
    from lfd_vehicle.watch_page import TOPICS, write_watch_page

    write_bag(recorder, out / "bag")
    if not all(map(recorder.count, TOPICS)):
        console.print(f"bag: {out / 'bag'}   nothing was judged: there is no report of it")
        return
    steps = recorder.steps()
    line = timeline((step.report for step in steps), 0)
    truth = recorder.messages("vehicle/truth")
    levels = [decision.level for decision in recorder.messages("diagnosis/decision")]
    safety = safety_of(truth, levels, truth[-1].collided)
    summary = {"lead": lead, "safety": safety.figures(), "sensors": score(line, faults)}
    write_text(out / "summary.json", json.dumps(summary, indent=1) + "\n")
    sensors = shown(line, faults)
    title = f"closed loop behind {lead}"
    report = write_report(out, title, Recording(steps, 0, faults), sensors, profile)
    page = write_watch_page(out / "bag", out / WATCH_PAGE, faults)
    print_table(result_table(sensors, f"{len(steps)} steps"))
    _print_safety(safety, console)
    console.print(f"bag: {out / 'bag'}   report: {report}   to watch: {page}", highlight=False)


def _print_safety(safety: Safety, console: Console) -> None:
    for name, text in safety.texts().items():
        console.print(f"{name:>24}: {text}", highlight=False)


def main() -> int:
    """Entry point of `lfd_bringup simulate`."""
    return run_command(main_simulate)
