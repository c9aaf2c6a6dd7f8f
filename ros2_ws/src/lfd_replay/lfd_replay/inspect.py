"""inspect: what is in a recording, and whether the graph can run on it."""

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_mpc.samples import Sample
from lfd_replay.command_line import print_table
from lfd_replay.drive_bag import open_bag
from lfd_replay.errors import WrongOption, run_command
from lfd_replay.inspection import cannot_run, inspect_streams, remarks
from lfd_replay.paths import named_path, refuse_to_overwrite
from lfd_replay.read_drive import (
    DRIVE_HELP,
    ReadOptions,
    add_read_options,
    files_read,
    is_bag,
    oddities,
    read_as_it_is,
    read_options,
    read_streams,
)
from lfd_replay.text_file import write_text


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: name, type, and how many messages it has."""

    name: str
    type: str
    messages: int


def _bag_topics(path: Path) -> list[Topic]:
    """All topics of a bag; none for another kind of recording. Raises UserError."""
    if not is_bag(path):
        return []
    with open_bag(path) as reader:
        return sorted(
            (Topic(c.topic, c.msgtype, c.msgcount) for c in reader.connections),
            key=lambda topic: topic.name,
        )


def _figure(value: float | None, unit: str = "", digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}{unit}"


def _inputs_table(figures: dict, title: str) -> Table:
    columns = ("input", "samples", "rate", "gaps", "longest", "steps", "repeated", "backward")
    table = Table(*columns, "ranges", title=title, title_justify="left")
    for name, values in figures["inputs"].items():
        ranges = [
            f"{signal} {_figure(r['least'], digits=2)} to {_figure(r['greatest'], digits=2)}"
            + (f" ({r['not_finite']} not finite)" if r["not_finite"] else "")
            for signal, r in values["ranges"].items()
        ]
        if "share_with_lead" in values:
            ranges.append(f"lead {values['share_with_lead']:.1%} ({values['leads']} ids)")
        table.add_row(
            name,
            str(values["samples"]),
            _figure(values["rate_hz"], " Hz", 1),
            str(values["gaps"]),
            _figure(values["longest_gap_s"], " s"),
            str(values["clock_steps"]),
            str(values["repeated_stamps"]),
            str(values["backward_stamps"]),
            "\n".join(ranges) or "-",
        )
    return table


def _read(path: Path, reading: ReadOptions) -> tuple[dict[str, list[Sample]], list[str], str]:
    """The streams of a recording, what is damaged, and why it is no drive (empty: it is one).

    Raises UserError for what cannot be read at all.
    """
    try:
        return *read_streams(path, reading), ""
    except WrongOption:
        raise
    except UserError as error:
        # It can be read, but is no drive: what the graph needs is not there or must be chosen.
        found = read_as_it_is(path, reading)
        if found is None:
            raise
        return *found, str(error).removeprefix(f"{path}: ")


def main_inspect(arguments: list[str]) -> int:
    """The command line of `inspect`."""
    parser = argparse.ArgumentParser(prog="inspect", description=__doc__)
    parser.add_argument("drive", type=named_path, help=DRIVE_HELP)
    add_read_options(parser)
    parser.add_argument("--json", type=named_path, metavar="FILE", help="write the figures there")
    options = parser.parse_args(arguments)

    reading = read_options(options)
    if options.json:
        refuse_to_overwrite(options.json, files_read(options, options.drive))
    streams, damage, problem = _read(options.drive, reading)
    topics = _bag_topics(options.drive)
    figures = inspect_streams(streams)
    if problem:
        figures["runs"], figures["missing"] = False, [problem]
    notes = [*damage, *remarks(figures), *oddities(streams)] if streams else []
    result = {
        "drive": str(options.drive),
        **figures,
        "remarks": notes,
        "topics": [asdict(topic) for topic in topics],
    }
    if options.json:
        write_text(options.json, json.dumps(result, indent=1, allow_nan=False) + "\n")
    if topics:
        table = Table("topic", "type", "messages", title="Topics", title_justify="left")
        for topic in topics:
            table.add_row(topic.name, topic.type, str(topic.messages))
        print_table(table)
    print_table(_inputs_table(figures, f"{options.drive}: {figures['duration_s']:.1f} s"))
    for note in notes:
        print(f"note: {note}")
    print(cannot_run(figures["missing"]) or "the graph can run on it")
    return 0


def main() -> int:
    """Entry point of `lfd_replay inspect`."""
    return run_command(main_inspect)
