"""The page in a real browser: it loads, every figure is drawn, a case can be chosen."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait
from test_live_equals_offline import drive

from lfd_replay.drawing.figure_files import write_figure
from lfd_replay.drawing.figure_page import cases_html, figure_html, table_html, write_page
from lfd_replay.drawing.figures import POINTS, Band, Figure, stretches, thinned
from lfd_replay.drawing.panels import Recording, contour_panels
from lfd_replay.drawing.paper_figures import (
    case_figure,
    confusion_figure,
    detector_curves,
    eigenvalue_figure,
    index_histograms,
    limits_figure,
    mpc_figure,
    reconstruction_figure,
)
from lfd_replay.evaluation.examples import EXAMPLES, Example, example_panel
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.recorded_step import RecordedStep

SETTINGS = graph_settings("paper")
WIDTHS = (1300, 1024)


def record(fault: str) -> Recording:
    faults = parse_faults([fault] if fault else [])
    samples = FaultInjector(faults, 0, seed=0).apply(drive(4.0))
    steps = OfflineGraph(SETTINGS).run(samples)
    return Recording([RecordedStep.offline(s) for s in steps], 0, faults)


def case(key: str, fault: str) -> Figure:
    injected = {name: (np.array([0.0, 4.0]), np.zeros(2)) for name in JUDGED}
    return case_figure(key, f"<{key}>", record(fault), injected, SETTINGS.diagnosis)


def row(name: str, size: float, **changes) -> dict:
    figures = {
        "name": name,
        "signal": "clearance",
        "kind": "offset",
        "size": size,
        "injected": ["clearance"],
        "detected": 0.9,
        "detected_low": 0.8,
        "detected_high": 0.95,
        "delay_s": 0.1,
        "delay_low_s": 0.08,
        "delay_high_s": 0.2,
    }
    return figures | changes


def others() -> list[Figure]:
    healthy = record("")
    rows = [
        row(name, size, signal=signal, injected=[signal], delay_s=None if size == 2.0 else 0.1)
        for name in ("one", "two")
        for size in (1.0, 2.0)
        for signal in JUDGED
    ]
    names = ("no fault", "relative velocity", "radar and acceleration")
    matrix = {injected: {reported: 3 for reported in names} for injected in names}
    return [
        eigenvalue_figure(SETTINGS.mpc),
        mpc_figure("mpc", "the controller", healthy),
        reconstruction_figure("reconstruction", "reconstruction", healthy),
        limits_figure("limits", "limits", healthy),
        index_histograms(
            {name: np.array([0.2, 0.9]) for name in JUDGED}, dict.fromkeys((*JUDGED, "all"), 0.94)
        ),
        detector_curves(rows, "rate"),
        detector_curves(rows, "delay"),
        confusion_figure({"one": matrix, "two": matrix, "three": matrix}),
    ]


@pytest.fixture(scope="module")
def cases() -> list[Figure]:
    return [case("healthy", ""), case("faulty", "offset:acceleration=4@2-3")]


@pytest.fixture(scope="module")
def figures() -> list[Figure]:
    return others()


def wait_for(browser: webdriver.Chrome, script: str) -> None:
    WebDriverWait(browser, 60).until(lambda b: b.execute_script(f"return {script}"))


def test_the_page_works_in_a_browser(
    browser: webdriver.Chrome, cases: list[Figure], figures: list[Figure], tmp_path: Path
) -> None:
    page = tmp_path / "index.html"
    body = [
        table_html(("a", "b"), [("<1>", "2" * 100)], "Table"),
        cases_html(cases),
        *map(figure_html, figures),
    ]
    write_page(page, "a <page>", body)
    browser.set_window_size(WIDTHS[0], 900)
    browser.get(page.as_uri())
    places = browser.find_elements(By.CSS_SELECTOR, ".figure")
    assert len(places) == len(figures) + 1
    wait_for(browser, f"document.querySelectorAll('.figure[data-drawn]').length === {len(places)}")
    for place in places:
        key = place.get_attribute("id")
        assert place.size["height"] > 200, key
        # Lines and bars are traces, contours are images.
        inside = place.find_elements(
            By.CSS_SELECTOR, ".cartesianlayer .trace, .cartesianlayer image"
        )
        assert inside, f"{key} is empty"
        wanted = next((f for f in figures if f.key == key), cases[0])
        titles = place.find_elements(By.CSS_SELECTOR, ".subplot")
        assert len(titles) == len(wanted.panels), key
    for width in WIDTHS:
        browser.set_window_size(width, 900)
        overflow = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        wait_for(browser, f"{overflow} <= 0")

    lane = "JSON.stringify(document.getElementById('cases').data.filter(t => t.name === 'FAULT'))"
    before = browser.execute_script(f"return {lane}")
    Select(browser.find_element(By.ID, "case")).select_by_visible_text("<faulty>")
    wait_for(browser, "document.getElementById('cases').dataset.drawn === 'faulty'")
    after = browser.execute_script(f"return {lane}")
    assert before != after
    browser.find_element(By.ID, "next").click()
    wait_for(browser, "document.getElementById('cases').dataset.drawn === 'healthy'")
    assert browser.execute_script(f"return {lane}") == before

    assert browser.title == "a <page>"
    loud = [entry for entry in browser.get_log("browser") if entry["level"] != "INFO"]
    assert loud == []
    fetched = browser.execute_script(
        "return performance.getEntriesByType('resource').map(r => r.name)"
        ".filter(n => !n.startsWith('data:') && !n.startsWith('blob:'))"
    )
    assert fetched == [], "the page must need no network"


def test_each_figure_is_drawn_into_a_file(
    cases: list[Figure], figures: list[Figure], tmp_path: Path
) -> None:
    for figure in (cases[1], *figures):
        path = write_figure(figure, tmp_path / "figures")
        assert path.name == f"{figure.key}.png" and path.read_bytes()[:4] == b"\x89PNG"
        assert path.stat().st_size > 8000, figure.key


def test_a_panels_legend_hides_no_line_of_it(
    cases: list[Figure], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn, savefig = [], Canvas.savefig

    def keep(canvas: Canvas, *args, **options) -> None:
        drawn.append(canvas)
        savefig(canvas, *args, **options)

    monkeypatch.setattr(Canvas, "savefig", keep)
    write_figure(cases[1], tmp_path)
    legends = [(axes, axes.get_legend()) for axes in drawn[0].axes if axes.get_legend()]
    assert "injected" in [text.get_text() for text in legends[-1][1].get_texts()]
    for axes, legend in legends:
        title = axes.get_title("left")
        assert legend.get_window_extent().y0 >= axes.get_window_extent().y1, title
        assert legend.get_window_extent().x0 > axes._left_title.get_window_extent().x1, title


def test_each_figure_says_what_it_shows(cases: list[Figure], figures: list[Figure]) -> None:
    for figure in (*cases, *figures):
        assert len(figure.says) > 40 and figure.says.endswith("."), figure.key


def test_what_the_observer_is_off_by_for_good_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A deviation about the mean would call a constant error none."""
    recording, own = record(""), Recording.bank
    before = reconstruction_figure("key", "title", recording).says
    monkeypatch.setattr(Recording, "bank", lambda self, name: own(self, name) + 5.0)
    after = reconstruction_figure("key", "title", recording).says
    rms = [float(re.search(r"by ([\d.]+) m/s² rms", said)[1]) for said in (before, after)]
    assert rms[0] < 3.0 < 4.9 < rms[1]


def test_a_case_has_the_panels_of_the_paper(cases: list[Figure]) -> None:
    letters = [panel.title[:3] for panel in cases[1].panels]
    assert letters == ["(a)", "(b)", "(c)", "(c)", "(d)", "(e)", "(f)"]
    contour = cases[1].panels[2].marks[0]
    assert contour.z.shape == (20, len(contour.x))


def test_the_contour_is_what_the_index_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = record("offset:clearance=4,relative_velocity=-10@2-3")
    monkeypatch.setattr("lfd_replay.drawing.panels.CONTOUR_STEPS", 1)
    drawn = contour_panels(recording, SETTINGS.diagnosis)
    for panel, signal in zip(drawn, JUDGED[:2], strict=True):
        index = recording.verdict(signal, "index")
        known = np.isfinite(index)
        assert index[known].max() > 0.5
        np.testing.assert_allclose(panel.marks[0].z.mean(axis=0)[known], index[known])


def test_a_thinned_line_keeps_its_extremes() -> None:
    x = np.arange(50_000.0)
    y = np.sin(x)
    y[777], y[4321], y[100:200] = 9.0, -9.0, np.nan
    few_x, few_y = thinned(x, y)
    assert len(few_x) <= POINTS + 100 and np.all(np.diff(few_x) > 0)
    assert np.nanmax(few_y) == 9.0 and np.nanmin(few_y) == -9.0
    assert few_x[np.nanargmax(few_y)] == 777 and np.isnan(few_y).any()
    np.testing.assert_array_equal(thinned(x[:100], y[:100])[1], y[:100])


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_a_thinned_line_keeps_short_parts_and_short_gaps(parts: int) -> None:
    """A held signal that is faulty for a second or three of an hour is one value in a few points;
    what is joined across a gap would say that it was faulty between, too."""
    x, y = np.arange(360_000) * 0.01, np.full(360_000, np.nan)
    for part in range(parts):
        y[180_000 + 150 * part :][:100] = 1.25
    few_x, few_y = thinned(x, y)
    found = stretches(Band("", few_x, few_y, few_y, ""))
    ends = [(float(part[0]), float(part[-1])) for part, _, _ in found]
    assert ends[0][0] == 1800.0 and ends[-1][1] == pytest.approx(1800.99 + 1.5 * (parts - 1))
    assert all(end - start == pytest.approx(0.99) for start, end in (ends[0], ends[-1]))
    assert len(ends) == min(parts, 2)
    assert (few_x[0], few_x[-1]) == (x[0], x[-1]) and len(few_x) < 200 + POINTS
    y = np.sin(x)
    y[200_000:200_010] = np.nan
    few_x, few_y = thinned(x, y)
    gap = few_x[np.isnan(few_y)]
    assert len(gap) and np.all((gap >= 2000.0) & (gap < 2000.1)), "a gap of 0.1 s is one"


def test_a_short_stretch_of_a_band_is_as_wide_as_it_is() -> None:
    x, value = np.arange(360_000) * 0.01, np.full(360_000, np.nan)
    value[180_000:180_050] = 1.0
    ((drawn, low, high),) = stretches(Band("", x, value, value + 1.0, ""))
    assert (drawn[0], drawn[-1]) == (x[180_000], x[180_049])
    assert set(low) == {1.0} and set(high) == {2.0}


def test_a_band_is_drawn_between_its_gaps_and_keeps_its_extremes() -> None:
    x = np.arange(50_000.0)
    low, high = -np.ones_like(x), np.ones_like(x)
    low[777], high[4321] = -9.0, 9.0
    low[100:200], high[20_000] = np.nan, np.nan
    found = stretches(Band("", x, low, high, ""))
    ends = [(float(part[0]), float(part[-1])) for part, _, _ in found]
    assert ends == [(0.0, 99.0), (200.0, 19_999.0), (20_001.0, 49_999.0)]
    assert sum(len(part) for part, _, _ in found) <= POINTS + len(found)
    assert min(low.min() for _, low, _ in found) == -9.0
    assert max(high.max() for _, _, high in found) == 9.0
    nothing = np.full(3, np.nan)
    assert stretches(Band("", x[:3], nothing, nothing, "")) == []


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.title)
def test_an_example_shows_a_fault_where_there_is_one(example: Example) -> None:
    panel = example_panel(example)
    (line,) = [mark for mark in panel.marks if mark.name == "called faulty"]
    called = line.x[np.isfinite(line.y)]
    assert panel.title == example.title and line.x[0] == pytest.approx(example.start, abs=0.02)
    assert bool(panel.shaded) == bool(example.faults) == bool(len(called))
    if example.faults:
        (injected,) = panel.shaded
        assert injected[0] < called[0] < injected[1] < called[-1] < injected[1] + 1.5
