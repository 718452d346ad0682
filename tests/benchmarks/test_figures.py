"""All figures: drawn, with their data, and the claims made with them."""

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.cases import link_cases
from benchmarks.figures import FIGURES, chosen, descent_gap, dial, draw_all, over_links
from benchmarks.figures.drawing import Drawing
from benchmarks.figures.mpc_runs import all_runs, peak

QUICK = ("2.2", "2.3", "2.4", "2.7", "2.8", "2.9", "3.3")
# What takes minutes is drawn here with little in it.
SMALLER: dict[str, Callable[[], Drawing]] = {
    "links": lambda: over_links.links([c for c in link_cases() if c.name in FEW_LINKS]),
    "3.13c": lambda: descent_gap.over_start(starts=2, few=3),
    "3.19": lambda: dial.total_costs((0.02, 0.4)),
}
FEW_LINKS = ("arm-03-links-0", "arm-05-links-0")
# These have tests of their own, which draw them.
ELSEWHERE = ("3.8", "3.9", "3.10", "3.11", "3.13a", "3.13b", "3.15", "basin")
SLOW = tuple(f.number for f in FIGURES if f.number not in (*QUICK, *ELSEWHERE))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Callable[[str], dict[str, np.ndarray]]:
    """Draw a figure once, however many tests look at it."""
    return cache(lambda number: draw(number, tmp_path_factory.mktemp("figures")))


def draw(number: str, out: Path) -> dict[str, np.ndarray]:
    """Draw, check both files, and return the data as the file has it."""
    (figure,) = chosen([number])
    if number in SMALLER:
        figure = replace(figure, draw=SMALLER[number])
    ((figure, drawing),) = draw_all([figure], out)
    picture = out / f"fig-{number}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size > 20_000
    assert drawing.sentence.startswith(f"Fig. {figure.number}: ")
    assert "Chosen here" in drawing.sentence
    with (out / f"fig-{number}.csv").open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == list(drawing.columns)
    assert all(name.endswith("]") for name in header), "every column has a unit"
    columns = zip(*rows, strict=True)
    return {
        name: np.array([float(value) for value in column if value])
        for name, column in zip(header, columns, strict=True)
    }


@pytest.mark.many
@pytest.mark.parametrize("number", QUICK)
def test_quick_figures_are_drawn(number, drawn):
    assert drawn(number)


@pytest.mark.slow
@pytest.mark.parametrize("number", SLOW)
def test_slow_figures_are_drawn(number, drawn):
    assert drawn(number)


@pytest.mark.slow
def test_the_figure_over_the_links_compares_with_the_best_known(drawn):
    data = drawn("links")
    assert list(data["links [-]"]) == [3, 5]
    assert data[f"gap, {over_links.DIRECT} [%]"].min() >= 0.0


def test_batch_and_recursion_agree(drawn):
    for number in ("2.3", "2.4"):
        data = drawn(number)
        for name in (name for name in data if ", batch" in name):
            other = data[name.replace("batch", "recursive")]
            # Fed forward, the unstable plant amplifies rounding.
            np.testing.assert_allclose(data[name], other, atol=1e-7)


def test_free_and_forced_responses_add_up(drawn):
    data = drawn("2.7")
    ahead = slice(7, None)
    total = data["y, free [-]"] + data["y, forced [-]"]
    np.testing.assert_allclose(total[ahead], data["y, all [-]"][ahead], atol=1e-12)


def test_cost_of_gpc_converges_with_the_horizon(drawn):
    data = drawn("2.9")
    for name in (name for name in data if name.startswith("cost")):
        assert data[name][0] > 1.5 * data[name][-1]
        assert data[name][4] <= 1.002 * data[name][-1]


@pytest.mark.slow
def test_constraints_hold_and_the_short_horizon_pushes_hardest():
    moving, still = all_runs(), all_runs(moving=False)
    for loop in (*moving.values(), *still.values()):
        assert np.abs(loop.x[:, 0]).max() <= 2.0 + 1e-6
        assert np.abs(loop.inputs).max() <= 40.0 + 1e-6
    assert peak(moving["N = 5"]) >= 1.15 * peak(moving["finite horizon"])
    assert peak(still["N = 5"]) < peak(still["finite horizon"])


@pytest.mark.slow
def test_a_smaller_interval_is_smoother_at_the_same_real_time_horizon(drawn):
    data = drawn("2.13")
    name = "u, dt = {} s, N = {} [N]".format
    coarse, same_time, same_count = (data[name(*a)] for a in ((0.05, 5), (0.01, 25), (0.01, 5)))
    late = coarse[10:], same_time[50:], same_count[50:]
    assert np.abs(late[1]).max() < np.abs(late[0]).max() < np.abs(late[2]).max()
    assert np.abs(np.diff(late[1])).max() < 0.5 * np.abs(np.diff(late[0])).max()


@pytest.mark.slow
def test_the_command_line_draws_what_it_is_told(tmp_path, capsys):
    assert main(["figures", "2.9", "2.7", "2.9", "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert shown.count("Fig. 2.9: ") == shown.count("Fig. 2.7: ") == 1
    assert {file.name for file in tmp_path.iterdir()} == {
        f"fig-{number}.{kind}" for number in ("2.7", "2.9") for kind in ("png", "csv")
    }


def test_an_unknown_number_is_said(tmp_path, capsys):
    assert main(["figures", "2.3", "9.9", "--out", str(tmp_path / "none")]) == 2
    said = capsys.readouterr().err
    assert "no figure has the number '9.9'" in said
    assert "2.14" in said
    assert not (tmp_path / "none").exists()


def test_no_number_means_all():
    assert chosen([]) == FIGURES
