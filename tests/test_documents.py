"""What the README says of the robust profile is what the table of results says."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()
RESULTS = (ROOT / "docs/robust-results.md").read_text()


def test_false_events_are_those_of_the_results() -> None:
    """A count of the paper profile, which stands in brackets there, tells which figure is meant."""
    rows = re.findall(r"^\| false events on .*\|$", README, re.MULTILINE)
    assert len(rows) > 5
    for row in rows:
        _, _, robust, paper, _ = row.split("|")
        figures = [
            [int(number) for number in re.findall(r"\d+", re.sub(r"\(.*?\)", "", cell))]
            for cell in (robust, paper)
        ]
        for here, there in zip(*figures, strict=True):
            if there == 0:
                continue
            before = [RESULTS[: match.start()] for match in re.finditer(rf"\({there}[),]", RESULTS)]
            said = [
                re.findall(r"\*\*(\d+)|\b(?:no|nor|none)\b", re.split(r"[(|]", text)[-1])[-1]
                for text in before
            ]
            assert here in {int(number or 0) for number in said}, (row, there)


def test_files_that_import_ros_are_named() -> None:
    """The layout names every module that is not plain; nodes are told by their names."""
    layout = README.partition("## Layout")[2]
    ros = re.compile(
        r"^\s*(?:import|from) (?:rclpy|ament_index_python|\w+_msgs\.|\w+_srvs\.)", re.M
    )
    for file in ROOT.glob("ros2_ws/src/lfd_*/lfd_*/**/*.py"):
        if ros.search(file.read_text()) and not file.name.endswith(("_node.py", "_adapter.py")):
            assert f"`{file.name}`" in layout, file
