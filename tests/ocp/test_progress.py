"""Long computations tell how far they are, and Ctrl-C keeps what was found."""

import io

import casadi as ca
import pytest

from ocp import OCP, Box, FeedbackLaw, Interrupted, Model, Plant, ProblemError, Rollout

from ocp import TextProgress, closed_loop, solve  # isort: skip
from ocp.closed_loop.plant import RunningPlant
from solvers import (
    CertifyOptions,
    Collocation,
    MultipleShooting,
    certify,
    multistart,
    refine_mesh,
)

X, U = ca.SX.sym("x"), ca.SX.sym("u")
LAG = OCP(
    name="lag",
    model=Model(name="lag", x=X, u=U, f=U - X**3),
    x0=[1.0],
    horizon=1.0,
    running_cost=X**2 + U**2,
    control_bounds=Box(-2, 2),
)
QUICK = CertifyOptions(starts=1, enumerate=False)


class Told:
    """Notes what it is told; raises what Ctrl-C raises at some report."""

    def __init__(self, stop_at: int = 99) -> None:
        self.reports: list[tuple[int, int, str]] = []
        self.stop_at = stop_at

    def __call__(self, done: int, total: int, said: str = "", /) -> None:
        self.reports.append((done, total, said))
        if len(self.reports) > self.stop_at:
            raise KeyboardInterrupt


def run(name: str, told: Told) -> object:
    if name == "multistart":
        return multistart(LAG, MultipleShooting(5), 3, 0, progress=told)
    if name == "refine_mesh":
        start = solve(LAG, MultipleShooting(5))
        return refine_mesh(start, solver=Collocation(2, degree=2), accuracy=1e-9, progress=told)
    if name == "certify":
        return certify(solve(LAG, MultipleShooting(20)), QUICK, progress=told)
    law = FeedbackLaw(law=lambda x, t: [-x[0]])
    return closed_loop(law, Plant(ocp=LAG), [1.0], 0.5, dt=0.1, progress=told)


NAMES = ("multistart", "refine_mesh", "certify", "loop")


@pytest.mark.parametrize("name", NAMES)
def test_it_tells_how_far_it_is_and_what_it_found(name: str) -> None:
    told = Told()
    run(name, told)
    done = [report[0] for report in told.reports]
    assert done == sorted(done)
    assert all(0 <= k <= total for k, total, _ in told.reports)
    assert told.reports[-1][0] == told.reports[-1][1], "the last report is the end"
    assert len(told.reports) > 2
    assert told.reports[-1][2]


@pytest.mark.parametrize("name", NAMES)
def test_ctrl_c_keeps_what_was_found(name: str) -> None:
    with pytest.raises(Interrupted, match="was stopped; what was found is in so_far") as stopped:
        run(name, Told(stop_at=3 if name == "certify" else 2))
    found = stopped.value.so_far
    assert isinstance(stopped.value, KeyboardInterrupt)
    if isinstance(found, Rollout):
        assert found.ended == "stopped by Ctrl-C"
        assert len(found.inputs) == len(found.costs) == len(found.t) - 1 == 3
    else:
        assert len(found) >= 1
        assert all(hasattr(each, "cost") for each in found)


def test_a_bar_of_text() -> None:
    stream = io.StringIO()
    bar = TextProgress(stream, width=10)
    bar(1, 4, "best cost 3")
    bar(4, 4)
    bar(0, 0)
    assert stream.getvalue().splitlines() == [
        "[##........] 1 of 4  best cost 3", "[##########] 4 of 4", "[##########] 0 of 0"
    ]  # fmt: skip


def test_a_terminal_gets_one_line() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    bar = TextProgress(stream)
    for _ in range(2):
        bar(1, 3, "a third")
        bar(2, 3, "more")  # the last report: the computation has stopped
    bar(3, 3, "all")
    up = "\x1b[A"
    lines = stream.getvalue().split("\n")
    assert [line.startswith(up) for line in lines] == [False, True, False, True, True, False]
    assert lines[-1] == "", "what is written next begins a line"
    bar(3, 3, "another")
    assert up not in stream.getvalue().split("\n")[-2]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"stream": 3}, "stream is .*it cannot be written to"),
        ({"width": -3}, "width"),
        ({"width": 2.5}, "width"),
    ],
)
def test_a_bar_that_cannot_be_drawn_is_refused(options, said) -> None:
    with pytest.raises(ProblemError, match=said):
        TextProgress(**options)


def test_a_report_that_the_system_fails_does_not_end_a_loop() -> None:
    reports = []

    def report(done: int, total: int, said: str = "", /) -> None:
        reports.append(done)
        if done == 2:
            raise OSError(28, "No space left on device")

    law = FeedbackLaw(law=lambda x, t: [-x[0]])
    with pytest.warns(RuntimeWarning, match="No space left .* reports no more"):
        rollout = closed_loop(law, Plant(ocp=LAG), [1.0], 0.5, dt=0.1, progress=report)
    assert reports == [1, 2]
    assert len(rollout.inputs) == 5


def test_ctrl_c_while_the_plant_moves_leaves_whole_steps(monkeypatch) -> None:
    calls, advance = [], RunningPlant.advance

    def stopped(self, given, dt):
        calls.append(given)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return advance(self, given, dt)

    monkeypatch.setattr(RunningPlant, "advance", stopped)
    with pytest.raises(Interrupted) as told:
        run("loop", Told())
    found = told.value.so_far
    assert found.ended == "stopped by Ctrl-C"
    assert len(found.t) == len(found.x) == 3
    for name in ("inputs", "measured", "costs", "decisions", "sources", "messages", "step_times"):
        assert len(getattr(found, name)) == 2, name


@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_called_is_refused(name: str) -> None:
    with pytest.raises(ProblemError, match="progress"):
        run(name, "bar")  # type: ignore[arg-type]
