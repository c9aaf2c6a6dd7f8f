"""What the README says of the profiles is what the tables of results and a replay say."""

import re
from pathlib import Path

import pytest

from lfd_bringup.replay import DEFAULT_DRIVE, DEFAULT_FAULT, event_line
from lfd_replay.evaluation.requirements.plan import full_extent
from lfd_replay.evaluation.requirements.rows import rows
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()
RESULTS = (ROOT / "docs/robust-results.md").read_text()

SUMS = {"1057", "1584"}
"""Windows of several offsets together, each of which the results count by itself."""


def figures(text: str) -> set[str]:
    """The numbers of a text, as they are written, of two digits or more: others are everywhere."""
    return set(re.findall(r"(?<![\d.])(?:\d{2,}|\d+\.\d+)(?!\d|\.\d)", text))


@pytest.mark.parametrize(
    ("header", "sources"),
    [
        ("| | robust | paper |", ("robust-results.md", "closed-loop.md")),
        ("| | hours | robust | paper |", ("robust-results.md",)),
        ("| fault, at equal false events on 27 normal drives |", ("evaluation.md",)),
    ],
)
def test_figures_of_a_table_are_those_of_its_source(header: str, sources: tuple[str, ...]) -> None:
    """Each is there; and in the same order, where the table gives several of a kind together."""
    there = " ".join((ROOT / "docs" / name).read_text() for name in sources)
    table = README[README.index(header) :].partition("\n\n")[0]
    assert table.count("\n") > 4
    assert not figures(table) - figures(there) - SUMS
    listed = there.replace(" and ", ", ")
    for together in re.findall(r"[\d.]+(?: / [\d.]+)+", table):
        assert together.replace(" / ", ", ") in listed, together


def test_false_events_are_those_of_the_results() -> None:
    """A count of the paper profile, which stands in brackets there, tells which figure is meant;
    where that is 0, words in brackets do."""
    table = README[README.index("| | hours | robust | paper |") :].partition("\n\n")[0]
    lines = table.splitlines()[2:]
    assert len(lines) > 10
    for row in lines:
        _, _, _, *cells, _ = row.split("|")
        counted = [[int(number) for number in re.findall(r"\d+", cell)] for cell in cells]
        assert counted[0]
        for robust, paper in zip(counted[::2], counted[1::2], strict=True):
            for here, there in zip(robust, paper, strict=True):
                assert here in said_with(there), (row, there)


def said_with(paper: int) -> set[int]:
    """The robust profile's figures that stand before that one of the paper profile in brackets."""
    mark = rf"\({paper}[),]" if paper else r"\(the paper profile has none"
    before = [RESULTS[: match.start()] for match in re.finditer(mark, RESULTS)]
    said = [
        re.findall(r"\*\*(\d+)|\b(?:no|nor|none)\b", re.split(r"[(|]", text)[-1])[-1]
        for text in before
    ]
    return {int(number or 0) for number in said}


def test_rows_that_need_recorded_drives_are_counted() -> None:
    everything, generated = (len(list(rows(full_extent(), known))) for known in (True, False))
    said = f"{everything - generated} of the {everything} rows"
    assert said in (ROOT / "docs/evaluation.md").read_text()


def test_files_that_import_ros_are_named() -> None:
    """The layout names every module that is not plain; nodes are told by their names."""
    layout = README.partition("## Layout")[2]
    ros = re.compile(
        r"^\s*(?:import|from) (?:rclpy|ament_index_python|\w+_msgs\.|\w+_srvs\.)", re.M
    )
    for file in ROOT.glob("ros2_ws/src/lfd_*/lfd_*/**/*.py"):
        if ros.search(file.read_text()) and not file.name.endswith(("_node.py", "_adapter.py")):
            assert f"`{file.name}`" in layout, file


def test_the_timeline_is_what_a_replay_prints() -> None:
    """The README's excerpt, line by line: a change of the algorithm changes its figures, too."""
    excerpt = re.findall(r"^ +\d+\.\d\d s  .*$", README, re.MULTILINE)
    assert len(excerpt) > 5
    drive = generate_drive(DEFAULT_DRIVE, seed=0, sensor="esr")
    faults = FaultInjector(parse_faults([DEFAULT_FAULT]), drive.zero, seed=0)
    steps = OfflineGraph(graph_settings("robust")).run(faults.apply(drive.samples))
    printed = [
        str(event_line(event, drive.zero)) for step in steps for event in step.outcome.events
    ]
    assert [line for line in printed if line in excerpt] == excerpt
