"""A process ends by its deadline, whatever it is doing."""

import subprocess
import sys

import pytest

WAITS = {
    "in Python": "time.sleep(30)",
    "in C, with Python's lock": "ctypes.PyDLL(None).sleep(30)",
    "in C, without it": "ctypes.CDLL(None).sleep(30)",
}


def status_of(text: str) -> int:
    code = f"import ctypes, sys, time\nfrom lfd_mpc.deadline import end_within\n{text}\nsys.exit(5)"
    return subprocess.run([sys.executable, "-c", code], timeout=20, check=False).returncode


@pytest.mark.parametrize("waits", WAITS.values(), ids=WAITS.keys())
def test_a_process_ends_by_its_deadline(waits: str) -> None:
    assert status_of(f"end_within(0.2)\n{waits}") == 0
    assert status_of(f"end_within(0.2, 130)\n{waits}") == 130


def test_a_process_that_ends_before_it_does_so_with_its_own_status() -> None:
    assert status_of("end_within(60.0)") == 5
