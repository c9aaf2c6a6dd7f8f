"""Where the recorded drives are, and a word when they are not there."""

import os
from pathlib import Path

import pytest

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
