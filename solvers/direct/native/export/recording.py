"""Steps of a loop as Python makes them, for the C to repeat."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ocp import MPC, InputSource, Plant, ProblemError, Rollout, Solution, UnsupportedProblem
from ocp.internal import ShiftedPlan
from solvers.direct.native.export.c_text import number
from solvers.direct.native.export.exported_loop import ExportedLoop

# Steps of a recording that export_c makes itself.
_STEPS = 20


@dataclass(frozen=True, eq=False)
class Recording:
    """Steps one after the other.

    Attributes:
        acting: the input until the first step acts (nu,).
        rows: time, measured state, parameters, input of every step.
    """

    acting: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, loop: ExportedLoop, rollout: Rollout | None) -> "Recording":
        """Take a rollout of the loop, or make one on the model.

        Raises:
            ProblemError: if the rollout has no decisions, or one that is not of an optimal plan.
        """
        nu = loop.original.model.nu
        if loop.controller is None:
            if rollout is not None:
                raise ProblemError("export_c: a rollout is that of an MPC, export that")
            return cls(np.zeros(nu), np.array(list(_solves(loop))))
        made = _made(loop, loop.controller) if rollout is None else rollout
        if not made.decisions:
            raise ProblemError("export_c: the rollout has no decisions: it was loaded, or is empty")
        sources = [decision.source for decision in made.decisions]
        others = [k for k, source in enumerate(sources) if source is not InputSource.OPTIMAL]
        if others and (rollout is not None or not others[0]):
            raise ProblemError(
                f"export_c: step {others[0]} of the recording is {sources[others[0]].name}, the C "
                "repeats OPTIMAL ones: record a loop that stays in reach of its constraints"
            )
        last = others[0] if others else len(sources)
        each = zip(made.decisions[:last], made.measured[:last], strict=True)
        rows = [[d.t, *x, *loop.flat(d.parameters), *d.input] for d, x in each]
        return cls(made.inputs[0] if made.late else np.zeros(loop.input_size), np.array(rows))

    @property
    def code(self) -> str:
        """The header with the recording."""
        rows = [f"  {{{', '.join(map(number, row.tolist()))}}}" for row in self.rows]
        acting = ", ".join(map(number, self.acting.tolist())) or "0.0"
        head = "/* What the loop decided in Python: time, measured state, parameters, input. */"
        return "\n".join(
            [
                head,
                f"#define RECORDED_STEPS {len(rows)}",
                f"static const double recorded_acting[] = {{{acting}}};",
                f"static const double recorded[RECORDED_STEPS][{max(1, self.rows.shape[1])}] = {{",
                ",\n".join(rows) + "};",
                "",
            ]
        )


def _made(loop: ExportedLoop, controller: MPC) -> Rollout:
    """Run a controller like the one that is exported on its own model."""
    own = MPC(
        ocp=controller.ocp,
        solver=controller.solver,
        dt=controller.dt,
        parameters=controller.parameters,
        guess=controller.guess,
        delay=controller.delay,
        applied=controller.applied,
        compensate=controller.compensate,
        tolerance=controller.tolerance,
        compiled=False,
    )
    plant = Plant(ocp=controller.ocp)
    return own.run(plant, loop.original.start(), _STEPS * controller.dt)


def _solves(loop: ExportedLoop) -> Iterator[list[float]]:
    """Yield a cold solve from the declared start, and warm ones along the plan."""
    program, flat = loop.solver_program, loop.flat({})
    plan: Solution = program.run()
    for k in range(len(plan.t) - 1):
        if not plan.status.is_success:
            if k == 0:
                raise UnsupportedProblem(
                    f"export_c: {loop.original.name}: from the declared start there is no answer "
                    f"to record: {plan.status.name}: {plan.message}"
                )
            return
        t, x = float(plan.t[0]), plan.x0
        yield [t, *x, *flat, *_first_input(loop, plan)]
        if loop.original.has_free_start or loop.original.has_free_time:
            return  # of one horizon: nothing follows it
        after = float(plan.t[1])
        plan = program.run(x0=plan.x[1], t0=after, guess=ShiftedPlan(plan, after))


def _first_input(loop: ExportedLoop, plan: Solution) -> np.ndarray:
    """Return the input of the first interval, as ``MPC`` reads it off a plan."""
    form, earlier = loop.form, ShiftedPlan(plan, float(plan.t[0]))
    nu, step = loop.original.model.nu, loop.dt / plan.duration
    if form is None or not len(form.rates):
        return plan.u[0]
    u = earlier.sample("u", np.array([0.5 * step]), nu)[0].copy()
    rated = loop.original.control_rates.index
    u[rated] = earlier.sample("u", np.array([step]), nu)[0, rated]
    return u
