"""``ExportedLoop``: a built solver, the way to it from the user's problem, and its loop."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp import MPC, OCP, Box, Program, UnsupportedProblem
from ocp.internal import (
    InNormalForm,
    InSizes,
    NormalForm,
    RewrittenProgram,
    RunData,
    check_instance,
)
from solvers.direct.multiple_shooting import MultipleShooting, MultipleShootingProgram
from solvers.direct.native.native_solve import NativeSolve
from solvers.direct.nlp_backends import NativeNlp

# As ``MPC`` builds its solver, but for the limit of time: the exported one knows no clock.
_NO_LIMIT = float("inf")


@dataclass(frozen=True, eq=False)
class ExportedLoop:
    """What is exported.

    Attributes:
        original: the problem as it was written.
        rewritings: what was done to it before the solver got it, in this order.
        solver_program: answers in the terms of the user.
        program: of the native backend, for the last of these problems.
        controller: the loop; None: a solver alone.
    """

    original: OCP
    rewritings: tuple[InNormalForm | InSizes, ...]
    solver_program: Program
    program: MultipleShootingProgram
    controller: MPC | None

    @classmethod
    def of(cls, source: MPC | Program) -> "ExportedLoop":
        """Take a controller or a built solver apart.

        Raises:
            UnsupportedProblem: naming what cannot be exported.
        """
        check_instance(source, (MPC, Program), "export_c: what to export")
        controller = source if isinstance(source, MPC) else None
        program = whole = _program_of(source) if isinstance(source, MPC) else source
        rewritings = []
        while isinstance(program, RewrittenProgram):
            if not isinstance(program.rewriting, InNormalForm | InSizes):
                break
            rewritings.append(program.rewriting)
            program = program.program
        if not isinstance(program, MultipleShootingProgram) or program.solver.backend != "native":
            raise UnsupportedProblem(
                f"export_c: {type(program).__name__} has no C; take an MPC around "
                "MultipleShooting(backend='native'), or what it builds. (A cost with kinks, such "
                "as an absolute value, is solved in other terms, which cannot be exported yet.)"
            )
        original = rewritings[0].original if rewritings else program.ocp
        loop = cls(original, tuple(rewritings), whole, program, controller)
        loop._refuse()
        return loop

    def _refuse(self) -> None:
        """Refuse by name what the C does not do."""
        name = f"export_c: {self.original.name}"
        if self.form is not None and self.form.has_jumps:
            raise UnsupportedProblem(
                f"{name}: constraints or data at instants are of one horizon, and are not exported"
            )
        loop = self.controller
        if loop is None:
            return
        if loop.real_time:
            raise UnsupportedProblem(
                f"{name}: real_time=True is not exported: the C solves at every step; leave it out"
            )

    @property
    def solve(self) -> NativeSolve:
        """The native solver in this process."""
        assert isinstance(self.program.nlp, NativeNlp)
        return self.program.nlp.run

    @cached_property
    def form(self) -> NormalForm | None:
        """The normal form, where there is one."""
        forms = [each.form for each in self.rewritings if isinstance(each, InNormalForm)]
        return forms[0] if forms else None

    @cached_property
    def in_sizes(self) -> InSizes | None:
        """The scaling, where there is one."""
        scalings = [each for each in self.rewritings if isinstance(each, InSizes)]
        return scalings[0] if scalings else None

    @property
    def dt(self) -> float:
        """Sampling interval [s]; of a solver alone its first interval."""
        if self.controller is not None:
            return self.controller.dt
        nodes = self.program.transcription.fractions
        return float(nodes[1] - nodes[0]) * self.original.duration

    @property
    def delay(self) -> float:
        """Time from measurement to effect [s]."""
        return self.controller.delay if self.controller else 0.0

    @property
    def sends_rate(self) -> bool:
        """Whether the plant receives the rate of the state, not the controls."""
        return self.controller is not None and self.controller.applied.what == "rate"

    @property
    def input_size(self) -> int:
        """How many numbers the plant receives."""
        return np.size(self.input_box.lower)

    @property
    def input_box(self) -> Box:
        """Bounds of what the plant receives."""
        if self.controller is None:
            return self.original.control_bounds
        return self.controller.applied.box(self.original)

    @property
    def compensates(self) -> bool:
        """Whether the state is predicted over the delay."""
        return self.controller is not None and self.controller.compensate

    # -- parameters ----------------------------------------------------------------------------

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """Parameters and signals of the user as declared, by name, in the order of the C."""
        return self.original.parameter_values().as_dict()

    def flat(self, given: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return parameters as one vector; of one that is not given as declared.

        Raises:
            UnsupportedProblem: if a signal has another number of samples than declared.
        """
        parts = [np.empty(0)]
        for name, declared in self.parameters.items():
            value = np.asarray(given.get(name, declared), dtype=float)
            if value.shape != declared.shape:
                raise UnsupportedProblem(
                    f"export_c: signal '{name}' has {len(value)} samples, in C the "
                    f"{len(declared)} that are declared: declare as many as the loop gives"
                )
            parts.append(value.ravel())
        return np.concatenate(parts)

    def by_name(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """Return a vector of parameters by name."""
        result, at = {}, 0
        for name, declared in self.parameters.items():
            result[name] = flat[at : at + declared.size].reshape(declared.shape)
            at += declared.size
        return result

    def run_data(self, x0: np.ndarray, flat: np.ndarray) -> RunData:
        """Return the data of a run of the solver, for those of the user."""
        given = self.by_name(flat)
        data = RunData.of(self.original, x0, 0.0, given)
        for each in self.rewritings:
            start, given = each.start(data), each.parameters(given)
            data = RunData.of(each.problem, start, 0.0, given)
        return data


def _program_of(controller: MPC) -> Program:
    """Build the solver of a loop, as the loop does."""
    solver = controller.solver
    if not isinstance(solver, MultipleShooting) or solver.backend != "native":
        raise UnsupportedProblem(
            f"export_c: {solver!r} has no C; take MultipleShooting(backend='native')"
        )
    return solver.for_control_loop(compiled=False, time_limit=_NO_LIMIT).build(controller.ocp)
