"""The report page."""

import re
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from test_live_equals_offline import drive

from lfd_diagnosis.verdict import COVERS, SIGNALS, State
from lfd_replay.drawing.panels import Recording, sensor_panel, verdict_panel
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import Fault, FaultInjector, parse_faults
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, graph_settings
from lfd_replay.recorded_step import RecordedStep
from lfd_replay.report import write_report
from lfd_replay.score import score, timeline

PLUS_MINUS = np.array([-1.0, 1.0])


def recorded(fault: str, profile: str = "paper") -> tuple[list[Fault], list[RecordedStep]]:
    faults = parse_faults([fault])
    samples = FaultInjector(faults, 0, seed=0).apply(drive(3.0))
    steps = [
        RecordedStep.offline(step) for step in OfflineGraph(graph_settings(profile)).run(samples)
    ]
    return faults, steps


def make_page(folder: Path, fault: str, profile: str = "paper") -> str:
    faults, steps = recorded(fault, profile)
    sensors = score(timeline((step.report for step in steps), 0), faults)
    recording = Recording(steps, 0, faults)
    path = write_report(folder, "a <drive> & more", recording, sensors, profile)
    assert [file.name for file in folder.iterdir()] == [path.name]
    return path.read_text()


def test_the_page_holds_everything_itself_and_tells_what_happened(tmp_path: Path) -> None:
    page = make_page(tmp_path, "offset:acceleration=4@1-2")
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=.https?:", page)
    assert "a &lt;drive&gt; &amp; more" in page and "<drive>" not in page
    assert "offset:acceleration=4@1-2" in page
    for panel in ("clearance", "fault index", "confidence", "count", "verdict"):
        assert f'"text":"{panel}"' in page
    assert '<td class="FAULT">FAULT</td>' in page and "observers exclude" in page


def test_the_reasons_are_read_on_a_narrow_screen_too(browser, tmp_path: Path) -> None:
    make_page(tmp_path, "offset:acceleration=4@1-2")
    browser.set_window_size(700, 900)
    browser.get((tmp_path / "report.html").as_uri())
    cut = "return [...document.querySelectorAll('.wide')].map(e => e.scrollWidth - e.clientWidth)"
    assert max(browser.execute_script(cut)) <= 0
    lines = (
        "return [...document.querySelectorAll('.wide:last-of-type td:first-child')]"
        ".map(e => { const r = document.createRange(); r.selectNodeContents(e);"
        " return r.getClientRects().length; })"
    )
    assert set(browser.execute_script(lines)) == {1}, "a time is on one line"


@pytest.mark.parametrize(
    ("fault", "state"),
    [
        ("dropout:radar@1-2", State.NO_DATA),
        ("offset:clearance=4,relative_velocity=-10@1-2", State.SUSPECT),
        ("offset:clearance=4,relative_velocity=-10@1-2", State.FAULT),
    ],
)
def test_the_panel_of_verdicts_shows_each_state(fault: str, state: State) -> None:
    faults, steps = recorded(fault)
    shown = {
        mark.name: mark
        for mark in verdict_panel(Recording(steps, 0, faults)).marks
        if mark.lane == SIGNALS[::-1].index("clearance")
    }
    times = [step.report.stamp * 1e-9 for step in steps if step.report.clearance.state == state]
    assert times
    for time in times:
        assert any(start <= time <= end for start, end in shown[state.name].intervals)
    assert len({mark.colour for mark in shown.values()}) == len(shown) == 5


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("signal", JUDGED)
@pytest.mark.parametrize("kind", ["offset:{}=4", "dropout:{}"])
def test_the_panel_of_a_sensor_shows_what_was_published(
    kind: str, signal: str, profile: str
) -> None:
    faults, steps = recorded(f"{kind.format(signal)}@1-2", profile)
    lost = len(steps) // 3
    steps[lost] = replace(steps[lost], reconstruction=None)
    panel = sensor_panel(Recording(steps, 0, faults), signal)
    band, rebuilt, measured, faulty = panel.marks
    assert panel.shaded == [(1.0, 2.0)]
    for k, step in enumerate(steps):
        horizon, made = step.horizon, step.reconstruction
        heard = not getattr(horizon, f"{signal}_stale")
        said = getattr(horizon, f"measured_{signal}") if heard else nan
        called = getattr(step.report, signal).state == State.FAULT
        value, std = nan, nan
        if made is not None and getattr(made, f"{signal}_valid"):
            value, std = getattr(made, signal), getattr(made, f"{signal}_std")
        np.testing.assert_equal(measured.y[k], said)
        np.testing.assert_equal(faulty.y[k], said if called else nan)
        np.testing.assert_equal(rebuilt.y[k], value)
        np.testing.assert_allclose((band.low[k], band.high[k]), value + COVERS * std * PLUS_MINUS)


def test_observers_are_shown_where_they_judge(tmp_path: Path) -> None:
    for profile in PROFILES:
        page = make_page(tmp_path, "offset:acceleration=4@1-2", profile)
        assert ("limits, lag 0" in page) == (profile == "paper")
        assert "its 95 % band" in page and "called faulty" in page


def test_a_drive_without_steps_says_so(tmp_path: Path) -> None:
    page = write_report(tmp_path, "nothing", Recording([], 0, []), {}, "robust").read_text()
    assert "There is no step" in page
