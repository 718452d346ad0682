"""What follows where the native solver fails: other ways, IPOPT, or in a control loop nothing."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import OCP, Compiler, Model, Status, solve
from ocp.internal import RunData, Transcription
from ocp.nlp.violated_row import most_violated
from solvers import MultipleShooting
from solvers.direct.native.flat_rows import FlatRows
from solvers.direct.native.native_library import NativeLibrary, NativeOptions, NativeReport
from solvers.direct.native.native_solve import ENDINGS, NativeLimits, NativeSolve
from solvers.direct.native.stage_code import StageCode
from solvers.direct.nlp_backends import NlpBackend
from solvers.direct.nlp_result import NlpResult
from tests.native.problems import impossible, swing

NATIVE = MultipleShooting(12, backend="native")


def at_rest() -> OCP:
    """A mass that stays where it is: no control moves from a first iterate of zeros."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    model = Model(name="mass", x=x, u=u, f=u)
    return OCP(name="at rest", model=model, x0=[0.0], horizon=1.0, running_cost=u**2 + x**2)


def native(time_limit: float = np.inf) -> tuple[NativeSolve, tuple]:
    """Return the solver of a swing, and what it is called with for a cold start."""
    tr = Transcription(swing(), 12, NATIVE.integrator)
    data = RunData.of(tr.ocp)
    bounds = tr.bounds(data)
    w0 = np.clip(np.zeros(tr.size), bounds["lbx"], bounds["ubx"])
    run = NativeSolve(NativeLibrary.of(StageCode(tr)), NativeLimits(1e-9, 300, time_limit))
    return run, (w0, tr.data_vector(data), bounds, None)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the backends that are built from here on."""
    names, build = [], NlpBackend.build

    def noted(self, transcription):
        names.append(self.name)
        return build(self, transcription)

    monkeypatch.setattr(NlpBackend, "build", noted)
    return names


def failing(monkeypatch: pytest.MonkeyPatch, after: int) -> list[int]:
    """Let the native solver find no step after so many runs; return a list with one entry a run."""
    calls, run = [], NativeSolve.__call__

    def noted(self, *given) -> NlpResult:
        calls.append(len(calls))
        result = run(self, *given)
        if len(calls) <= after:
            return result
        stats = result.stats | {"return_status": "no step", "success": False}
        report = result.stats["report"]._replace(dual=1.0)
        return replace(result, stats=stats | {"report": report})

    monkeypatch.setattr(NativeSolve, "__call__", noted)
    return calls


def test_a_failure_is_handed_to_ipopt_which_goes_on(monkeypatch, built: list[str]) -> None:
    calls = failing(monkeypatch, after=0)
    solution = solve(at_rest(), NATIVE)
    assert solution.status is Status.SOLVED
    assert "by IPOPT" in solution.message
    assert len(calls) == 1  # the run from perturbed controls is IPOPT's too
    assert built.count("ipopt") == 1


def test_a_failure_from_perturbed_controls_is_handed_over(monkeypatch) -> None:
    calls = failing(monkeypatch, after=1)
    assert solve(at_rest(), NATIVE).status is Status.SOLVED
    assert len(calls) == 2


def test_in_a_control_loop_nothing_else_is_built(monkeypatch, built: list[str]) -> None:
    solver = NATIVE.for_control_loop(compiled=False, time_limit=5.0)
    assert not solver.build(impossible()).run().status.is_success
    failing(monkeypatch, after=0)
    assert solver.build(swing()).run().status is Status.FAILED
    assert "ipopt" not in built


def test_the_best_of_all_ways_comes_back(monkeypatch) -> None:
    reports, report = [], NativeLibrary.report

    def worse(self) -> NativeReport:
        found = report(self)._replace(primal=float(len(reports)))
        reports.append(found)
        return found

    monkeypatch.setattr(NativeLibrary, "report", worse)
    no_step = ENDINGS.index("no step")
    monkeypatch.setattr(NativeLibrary, "solve", _ended(NativeLibrary.solve, no_step))
    run, given = native()
    result = run(*given)
    assert len(reports) == 2
    assert result.stats["report"] == reports[0]
    assert result.iterations == sum(r.iterations for r in reports)
    assert result.work.factorisations == sum(r.factorisations for r in reports)


def test_no_way_begins_without_time(monkeypatch) -> None:
    calls: list[int] = []
    ended = _ended(NativeLibrary.solve, ENDINGS.index("no step"), calls)
    monkeypatch.setattr(NativeLibrary, "solve", ended)
    run, given = native(time_limit=1e-9)
    run(*given)
    assert len(calls) == 1


def _ended(solve_, ending: int, calls: list[int] | None = None):
    """Return what solves and says that it has ended in another way."""

    def ended(self: NativeLibrary, options: NativeOptions) -> int:
        found = solve_(self, options)
        if calls is not None:
            calls.append(found)
        return ending

    return ended


@pytest.mark.parametrize("name", ["values", "lam_g", "multipliers_of_bounds"])
def test_what_is_no_number_is_no_result(monkeypatch, name: str) -> None:
    right = getattr(FlatRows, name)
    monkeypatch.setattr(FlatRows, name, lambda *given: right(*given) * np.nan)
    run, given = native()
    result = run(*given)
    assert result.is_undefined
    np.testing.assert_array_equal(result.w, given[0])


def test_what_is_no_number_violates() -> None:
    tr = Transcription(swing(), 12, NATIVE.integrator)
    bounds = tr.bounds(RunData.of(tr.ocp))
    g = np.zeros(len(tr.rows))
    g[3] = np.nan
    violation, row = most_violated(np.zeros(tr.size), g, bounds, tr.rows, tr._bound)
    assert violation == np.inf
    assert row is tr.rows[3]


def test_the_last_note_is_that_of_the_last_iterate() -> None:
    run, given = native()
    few = NativeLibrary.of(run.library.code, Compiler(flags=("-O1", "-DNOTED=4")))
    result = replace(run, library=few)(*given)
    assert result.iterations > 4
    notes = result.history("inf_du")
    assert len(notes) == 4
    assert notes[-1] == result.stats["report"].dual
