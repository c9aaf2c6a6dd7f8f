"""The report page."""

import re
from pathlib import Path

from test_live_equals_offline import drive

from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.recorded_step import RecordedStep
from lfd_replay.report import write_report
from lfd_replay.score import score, timeline


def make_page(folder: Path, fault: str) -> str:
    faults = parse_faults([fault])
    samples = FaultInjector(faults, 0, seed=0).apply(drive(3.0))
    steps = [
        RecordedStep(step.horizon, step.bank, step.outcome.report)
        for step in OfflineGraph(graph_settings("paper")).run(samples)
    ]
    sensors = score(timeline((step.report for step in steps), 0), faults)
    path = write_report(folder, "a <drive> & more", steps, 0, faults, sensors)
    assert [file.name for file in folder.iterdir()] == [path.name]
    return path.read_text()


def test_the_page_holds_everything_itself_and_tells_what_happened(tmp_path: Path) -> None:
    page = make_page(tmp_path, "offset:acceleration=4@1-2")
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=.https?:", page)
    assert "a &lt;drive&gt; &amp; more" in page and "<drive>" not in page
    assert "offset:acceleration=4@1-2" in page
    for panel in ("clearance (m)", "fault index", "confidence (steps)", "verdict"):
        assert panel in page
    assert '<td class="FAULT">FAULT</td>' in page and "observers exclude" in page


def test_a_drive_without_steps_says_so(tmp_path: Path) -> None:
    page = write_report(tmp_path, "nothing", [], 0, [], {}).read_text()
    assert "There is no step" in page
