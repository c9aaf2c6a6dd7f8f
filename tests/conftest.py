"""What tests share: the recorded drives, a browser, and cars for the robust profile."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from copy import copy, deepcopy
from pathlib import Path

import pytest
from robust_car import Car
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

from lfd_diagnosis.verdict import State

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

DATA = Path(__file__).parent.parent.parent / "shared" / "data"


def pytest_report_header() -> str:
    there = "there" if DATA.is_dir() else "NOT there: tests on them are skipped"
    return f"recorded drives: {there}"


@pytest.fixture
def data() -> Path:
    """The folder of recorded drives."""
    if not DATA.is_dir():
        pytest.skip("the recorded drives (../shared/data) are not there")
    return DATA


@pytest.fixture(scope="module")
def browser() -> Iterator[webdriver.Chrome]:
    program, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("NOT RUN: no browser here (chromium and chromedriver)")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    with tempfile.TemporaryDirectory() as profile:
        for flag in (
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            f"--user-data-dir={profile}",
        ):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        chrome = webdriver.Chrome(options=options, service=Service(driver))
        yield chrome
        chrome.quit()


@pytest.fixture(scope="module")
def ready_car() -> Car:
    made = Car()
    report = made.drive(12.0).report
    assert {report.clearance.state, report.radar.state, report.acceleration.state} == {State.OK}
    assert report.host_speed.state == State.OK
    assert not made.faults_since(0)
    return made


@pytest.fixture
def car(ready_car: Car) -> Car:
    """A car of each test's own that has driven for 12 s."""
    made = copy(ready_car)
    made.outcomes = list(made.outcomes)
    made.diagnosis, made.bank, made.random = deepcopy((made.diagnosis, made.bank, made.random))
    return made


@pytest.fixture
def standing(car: Car) -> Car:
    """The car has come to rest, and its wheels say so."""
    start = car.number
    car.brake(0.02, 2.0, to=0.02)
    car.speed = 0.0
    car.drive(3.0, host_speed_is=0.0)
    assert not car.faults_since(start)
    return car
