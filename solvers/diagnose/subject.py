"""A problem under examination, with what several checks need, computed once."""

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ocp import OCP, Program, Solution
from ocp.internal import NormalForm, RunData, number_of, scaled
from solvers.diagnose.terms import Terms
from solvers.direct.multiple_shooting import MultipleShooting, MultipleShootingProgram

# Random points around the guess, for what must hold everywhere.
_RANDOM = 20
# Intervals of the elastic problem, which is solved a dozen times.
_COARSE = 30


@dataclass(frozen=True, eq=False)
class SamplePoints:
    """Where functions are evaluated: K rows of each argument.

    Attributes:
        x: states (K, nx).
        u: controls (K, nu).
        t: instants [s], (K,).
        p: parameters (K, n_p).
    """

    x: np.ndarray
    u: np.ndarray
    t: np.ndarray
    p: np.ndarray

    def evaluate(self, ocp: OCP, expression: ca.SX) -> np.ndarray:
        """Return an expression at every point, (K, numel)."""
        m, value = ocp.model, ca.densify(ca.vec(expression))
        function = ca.Function("value", [m.x, m.u, m.t, ocp.p], [value])
        found = function.map(len(self.t))(self.x.T, self.u.T, self.t[None, :], self.p.T)
        return np.array(found).reshape(value.numel(), len(self.t), order="F").T

    def __add__(self, other: "SamplePoints") -> "SamplePoints":
        """Return both."""
        pairs = [(getattr(self, n), getattr(other, n)) for n in ("x", "u", "t", "p")]
        return SamplePoints(*[np.concatenate(pair) for pair in pairs])


@dataclass(frozen=True, eq=False)
class DiagnosedProblem:
    """A problem under examination.

    Attributes:
        ocp: the problem.
        data: start, initial time and parameters of the run.
        solver: the direct method that tries it.
        given: the solution that was asked about, if any.
        form: where the problem is a normal form, all of it.
    """

    ocp: OCP
    data: RunData
    solver: MultipleShooting
    given: Solution | None = None
    form: NormalForm | None = None

    @cached_property
    def terms(self) -> Terms:
        """The words of the user."""
        return Terms.of(self.ocp, self.form)

    @property
    def written(self) -> OCP:
        """The problem as it was written, with its algebraic variables solved for."""
        return self.terms.written

    @cached_property
    def constants(self) -> list[int]:
        """Which states are unknown constants."""
        places = self.form.unknowns.values() if self.form else ()
        return [i for at in places for i in range(at.start, at.stop)]

    @cached_property
    def copies(self) -> dict[int, int]:
        """Which states are copies of others at the start: copy and original."""
        if self.form is None:
            return {}
        own, start = self.form.from_start, self.form.start
        return dict(zip(range(start.start, start.stop), own, strict=True))

    @cached_property
    def start_directions(self) -> np.ndarray:
        """In which directions the start may move, (nx, k): a copy moves with its original."""
        free, copies = self.ocp.start_is_free, self.copies
        own = [i for i in np.flatnonzero(free).tolist() if i not in copies]
        moves = np.eye(self.ocp.model.nx)
        for copy, original in copies.items():
            moves[copy, original] = 1.0
        return moves[:, own]

    @cached_property
    def program(self) -> MultipleShootingProgram:
        """The problem, built."""
        return self.solver.prepare(self.ocp)

    @cached_property
    def coarse(self) -> "DiagnosedProblem":
        """The same on fewer intervals with more steps in each, where many solves are needed."""
        count = number_of(self.solver.intervals)
        if self.ocp.steps or count <= _COARSE:
            return self
        steps = -(-count * self.solver.integrator.steps // _COARSE)
        finer = replace(self.solver.integrator, steps=steps)
        coarse = replace(self.solver, intervals=_COARSE, integrator=finer, blocks=())
        return replace(self, solver=coarse)

    @cached_property
    def guess(self) -> tuple[np.ndarray, np.ndarray]:
        """The first iterate: states with the free final time (N + 1, nz), controls (N, nu).

        Clipped to the bounds, as the solver does it.
        """
        z, u = self.program.first_iterate(self.data, self.ocp.guess)
        nx, start = self.ocp.model.nx, z[0].copy()
        z = np.hstack([self.ocp.state_bounds.clip(z[:, :nx]), z[:, nx:]])
        return np.vstack([start, z[1:]]), self.ocp.control_bounds.clip(u)

    @cached_property
    def trial(self) -> Solution:
        """The solution of the direct method; in sizes of the problem's own where it needs them."""
        found = self._tried(self.program)
        if found.status.is_success or scaled(self.ocp) is None:
            return found
        again = self._tried(self.solver.build(self.ocp))
        return again if again.status.is_success else found

    def _tried(self, program: Program) -> Solution:
        guess = self.given if self.given is not None and self.given.status.is_success else None
        values = self.data.values.as_dict()
        return program.run(x0=self.data.x0, t0=self.data.t0, parameters=values, guess=guess)

    @property
    def is_solved(self) -> bool:
        """Whether there is an answer: the given one, or that of the trial."""
        given = self.given is not None and self.given.status.is_success
        return given or self.trial.status.is_success

    @cached_property
    def along(self) -> SamplePoints:
        """The nodes of the first iterate; the last control is held at the end."""
        z, u = self.guess
        fractions = self.program.transcription.fractions
        unit = self.program.transcription.time_unit
        duration = z[0, -1] * unit if self.ocp.has_free_time else self.ocp.duration
        return self._points(z[:, : self.ocp.model.nx], u, fractions, duration)

    @cached_property
    def tried(self) -> SamplePoints:
        """The nodes of the trial."""
        s = self.trial
        return self._points(s.x, s.u, s.fractions, s.duration)

    def _points(
        self, x: np.ndarray, u: np.ndarray, fractions: np.ndarray, duration: float
    ) -> SamplePoints:
        t = self.data.t0 + fractions * duration
        return SamplePoints(x, np.vstack([u, u[-1:]]), t, self.data.values.at(fractions))

    @cached_property
    def around(self) -> SamplePoints:
        """Random points within the bounds, or around the first iterate where there are none."""
        rng, near = np.random.default_rng(0), self.along
        rows = rng.integers(len(near.t), size=_RANDOM)
        ocp = self.ocp

        def scattered(values: np.ndarray) -> np.ndarray:
            size = 1.0 + np.abs(near_of(values)).max(axis=0)
            return values[rows] + rng.normal(size=(_RANDOM, values.shape[1])) * size

        def near_of(values: np.ndarray) -> np.ndarray:
            return np.where(np.isfinite(values), values, 0.0)

        x = ocp.state_bounds.clip(scattered(near.x))
        u = ocp.control_bounds.clip(scattered(near.u))
        return SamplePoints(x, u, near.t[rows], near.p[rows])

    def excited(self, seed: int) -> np.ndarray:
        """Return random controls within their bounds, or within 1 where they have none, (N, nu)."""
        bounds, rng = self.ocp.control_bounds, np.random.default_rng(seed)
        low = np.where(np.isfinite(bounds.lower), bounds.lower, -1.0)
        high = np.where(np.isfinite(bounds.upper), bounds.upper, 1.0)
        shape = (self.program.transcription.n, self.ocp.model.nu)
        return low + (high - low) * rng.uniform(size=shape)

    def unit(self, name: str) -> str:
        """Return the unit of a state or control; empty where none was declared."""
        m = self.ocp.model
        for names, units in ((m.x_names, m.x_units), (m.u_names, m.u_units)):
            if name in names and units:
                return units[names.index(name)]
        return "s" if name == "final time" else ""
