"""``python -m benchmarks mpc`` and ``faults``, as they are typed, with little to do."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.mpc import commands
from benchmarks.mpc.arm_loop import INSTANTANEOUS
from benchmarks.mpc.dial import LOOPS
from benchmarks.mpc.faults import FaultReport
from benchmarks.mpc.loop_row import read_loops

CLEAN = FaultReport(
    subject="cart", steps=10, faults=Counter(), sources=Counter(), bad_inputs=0, unnamed=0,
    lies=0, slow=0, refused=0, replayed=3, differing=0,
)  # fmt: skip


@pytest.mark.slow
def test_the_dial_prints_rows_and_crossings_and_runs_nothing_twice(tmp_path: Path, capsys) -> None:
    words = ["mpc", "--scenarios", "arm-004", "--controllers", "direct", "--horizons", "0.02"]
    words += ["0.2", "--out", str(tmp_path)]
    assert main(words) == 0
    shown = capsys.readouterr().out
    for word in ("arm-004", "instantaneous", "direct", "optimal 75", "from which horizon on [s]"):
        assert word in shown
    cost = {
        (row.controller, row.horizon): row.cost or np.nan for row in read_loops(tmp_path / LOOPS)
    }
    assert len(cost) == 3
    # The crossing that the last table names is that of the rows.
    assert cost["direct", 0.2] < cost[INSTANTANEOUS, 0.0] < cost["direct", 0.02]
    last = [line for line in shown.splitlines() if line.startswith("│ arm-004")][-1]
    assert [cell.strip() for cell in last.split("│")[2:4]] == ["0.2", "0.2"]

    written = (tmp_path / LOOPS).read_bytes()
    assert main(words) == 0
    assert (tmp_path / LOOPS).read_bytes() == written
    assert capsys.readouterr().out == shown


@pytest.mark.slow
def test_the_short_tables_are_printed(capsys) -> None:
    words = ["mpc", "--short", "endings", "delay", "mass", "--scenarios", "arm-004"]
    assert main([*words, "--horizons", "0.1"]) == 0
    shown = capsys.readouterr().out
    for word in ("terminal costs", "lingering", "previous", "computing delay of 40 ms", "not comp"):
        assert word in shown
    assert "mass of 2.92" in shown


@pytest.mark.slow
def test_the_cart_pole_is_printed(capsys) -> None:
    assert main(["mpc", "--short", "cart-pole", "--horizons", "1"]) == 0
    shown = capsys.readouterr().out
    assert "|force| <= 12 N, |position| <= 0.6 m" in shown
    lines = [line for line in shown.splitlines() if line.startswith("│")]
    assert [line.split("│")[2].strip() for line in lines] == [
        "ipopt", "fatrop", "newton", "shooting-5", "fatrop", "fatrop",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_short_campaign_is_clean(capsys) -> None:
    assert main(["faults", "--steps", "100", "--seed", "1"]) == 0
    shown = capsys.readouterr().out
    assert "cart: 50 steps, clean" in shown
    assert "arm: 20 steps, clean" in shown
    assert "heating: 30 steps, clean" in shown
    assert "0 inputs not finite or out of bounds" in shown


@pytest.mark.parametrize("what", ["bad_inputs", "unnamed", "lies", "slow", "refused", "differing"])
def test_whatever_a_campaign_finds_is_said_and_is_no_success(
    what: str, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = replace(CLEAN, **{what: 2})
    monkeypatch.setattr(commands, "campaign", lambda name, steps, **_: iter([found]))
    assert main(["faults", "--steps", "10"]) == 1
    shown = capsys.readouterr().out
    assert "NOT CLEAN" in shown
    assert "2" in shown.split("cart: ")[-1].replace("2 of 3", "2")


@pytest.mark.parametrize(
    "words",
    [
        ["mpc", "--scenarios", "arm-999"],
        ["mpc", "--controllers", "nobody"],
        ["mpc", "--horizons", "0"],
        ["mpc", "--horizons", "inf"],
        ["mpc", "--horizons", "soon"],
        ["mpc", "--short", "nothing"],
        ["faults", "--steps", "0"],
    ],
)
def test_bad_words_end_with_a_message(words: list[str], capsys) -> None:
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert words[1] in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["--short", "cart-pole"], ["--scenarios", "arm-004", "--controllers", "direct"]]
)
def test_a_horizon_below_the_interval_is_said(words: list[str], tmp_path: Path, capsys) -> None:
    assert main(["mpc", *words, "--horizons", "0.005", "--out", str(tmp_path)]) == 2
    assert "longer than the horizon" in capsys.readouterr().out.replace("\n", " ")
