"""What commands write and print: of what they are, and wherever it goes."""

import json
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest

from lfd_replay.drawing.figure_page import drawn, write_page
from lfd_replay.drawing.figures import Figure, Line, Panel
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.journal import Journal
from lfd_replay.paper_evaluation import main_paper_evaluation
from lfd_replay.profiles import profile_file_text
from ros_support import ROOT

HEADER = "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2"


def drive(path: Path) -> Path:
    """A drive of 3 s behind a lead that keeps its distance."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([HEADER, *(f"{k / 20},30,0,15,0.1" for k in range(60))]) + "\n")
    return path


def parameters(path: Path, profile: str) -> Path:
    """The parameter file of a profile."""
    path.write_text(profile_file_text(profile))
    return path


@pytest.mark.parametrize("count", [1, 2])
def test_the_profile_that_is_named_is_the_one_that_judged(count: int, tmp_path, capsys) -> None:
    """A parameter file's own profile takes precedence, and calibrate writes one."""
    params, out = parameters(tmp_path / "p.yaml", "paper"), tmp_path / "out.json"
    drives = [str(drive(tmp_path / f"{k}.csv")) for k in range(count)]
    asked = ["--profile", "robust", "--params", str(params), "--json", str(out), "--jobs", "1"]
    page = tmp_path / "page"
    report = ["--report", str(page)] if count == 1 else []
    assert run_command(main_evaluate, [*drives, *asked, *report]) == 0
    result = json.loads(out.read_text())
    assert {each["profile"] for each in result.get("drives", [result])} == {"paper"}
    assert "profile paper" in capsys.readouterr().out.splitlines()[0]
    if report:
        assert "between the limits of the observers" in (page / "report.html").read_text()


def test_the_papers_evaluation_is_of_no_other_profile(tmp_path: Path, capsys) -> None:
    params, out = parameters(tmp_path / "p.yaml", "robust"), tmp_path / "out"
    assert run_command(main_paper_evaluation, ["--params", str(params), "--out", str(out)]) == 2
    assert capsys.readouterr().err == (
        f"--params {params}: is of the robust profile; a file of the paper profile is expected, "
        "as `calibrate --profile paper` writes it\n"
    )
    assert not out.exists()


@pytest.mark.parametrize("damage", [b"\xff", b"\0" * 8, b"17", b"[]", b'{"key": "b"}', b'{"ke'])
def test_a_damaged_line_of_a_journal_costs_its_own_result_alone(damage: bytes, tmp_path) -> None:
    kept = tmp_path / "journal"
    Journal(kept).add("a", 1)
    with kept.open("ab") as file:
        file.write(b"\n" + damage)
    Journal(kept).add("c", 3)
    assert Journal(kept).results == {"a": 1, "c": 3}
    kept.write_bytes(damage)
    assert Journal(kept).results == {}
    Journal(kept).add("d", 4)
    assert Journal(kept).results == {"d": 4}, "one without a head begins anew"


def test_names_with_brackets_are_printed_as_they_are(tmp_path: Path, capsys) -> None:
    drives = [str(drive(tmp_path / name)) for name in ("a[old]b.csv", "dir[/b].csv")]
    for asked in (drives, drives[:1], drives[1:]):
        assert run_command(main_evaluate, [*asked, "--jobs", "1"]) == 0
        printed = capsys.readouterr().out
        assert all(Path(path).name in printed for path in asked)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("place", ["/dev/stdout", ">(cat)"])
def test_figures_go_through_a_pipe(place: str, count: int, tmp_path: Path) -> None:
    drives = [str(drive(tmp_path / f"{k}.csv")) for k in range(count)]
    command = [ROOT / "run", "lfd_replay", "evaluate", *drives, "--jobs", "1"]
    shell = ["bash", "-c", f'"$@" --json {place} | cat', "bash", *command]
    done = subprocess.run(shell, capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    result, _ = json.JSONDecoder().raw_decode(done.stdout[done.stdout.index("{") :])
    assert [each["steps"] > 0 for each in result.get("drives", [result])] == [True] * count


@pytest.mark.parametrize("name", ["%BODY%", "%TITLE%", "%PLOTLY%", "%SCRIPT%", "100%A%", r"\1"])
def test_the_name_of_a_place_of_the_page_is_a_title_like_others(name: str, tmp_path) -> None:
    page, said = tmp_path / "page.html", f"<p>{name}</p>"
    write_page(page, name, [said])
    text = page.read_text()
    assert f"<title>{name}</title>" in text and f"<h1>{name}</h1>" in text
    assert text.count(said) == 1 and text.count("function draw(") == 1


def test_a_value_beyond_small_numbers_is_a_gap_of_the_page() -> None:
    y = np.array([1.0, 1e300, 2.0])
    line = Line("value", np.arange(3.0), y, "#000000")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = drawn(Figure("key", "title", "says", [Panel("panel", "x", "y", [line])]))
    assert "Infinity" not in figure and json.loads(figure)["data"][0]["name"] == "value"
