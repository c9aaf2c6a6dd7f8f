"""Where the recorded drives are, and a word when they are not there."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

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
