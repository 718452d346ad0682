"""Of what is done many times a third runs, and what is chosen by name as a whole."""

import subprocess
import sys

import pytest

_FILE = "tests/mpc/test_faults.py"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chosen", "number"),
    [
        ([_FILE], 1),
        ([_FILE, "-k", "gets_through"], 3),
        ([f"{_FILE}::test_no_fault_gets_through"], 3),
    ],
)
def test_what_is_chosen_by_name_runs_as_a_whole(chosen: list[str], number: int) -> None:
    asked = [sys.executable, "-m", "pytest", "-n", "0", "-q", "--collect-only", *chosen]
    said = subprocess.run(asked, check=True, capture_output=True, text=True).stdout
    assert said.count("test_no_fault_gets_through[") == number
