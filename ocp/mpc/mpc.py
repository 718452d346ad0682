"""Receding-horizon control (Algorithm 3): a controller around any solver."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from math import inf
from threading import Lock, get_ident
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.arguments import (
    check_callable,
    check_flag,
    check_instance,
    check_not_negative,
    check_numbers,
    check_positive,
)
from ocp.checks.errors import ProblemError, UnsupportedProblem
from ocp.checks.progress import Progress
from ocp.closed_loop.decision import ControlRefused, Decision, StepReport
from ocp.closed_loop.delay import delay_steps
from ocp.closed_loop.guarded_call import CALLBACK_ERRORS
from ocp.closed_loop.plant import Plant
from ocp.closed_loop.rollout import Rollout
from ocp.closed_loop.simulate import Observer, closed_loop
from ocp.mpc.backup_selection import Backup, BackupOption, select_backup
from ocp.mpc.controller_state import ControllerState
from ocp.mpc.fallback_ladder import FallbackLadder
from ocp.mpc.plant_input import PlantInput
from ocp.mpc.step_inputs import Parameters
from ocp.mpc.terms_of_one_horizon import refuse_terms_of_one_horizon
from ocp.problem.ocp import OCP
from ocp.problem.scaled import row_sizes
from ocp.solution.solver import InitialGuess, Solver, why_no_feedback

T = TypeVar("T")

# What a run may take where a solver sets no limit [s]: far more than a control loop has.
_TIME_LIMIT = 10.0


@dataclass(eq=False, kw_only=True)
class MPC:
    """A receding-horizon controller around any solver, for a problem that moves with time.

    At every step the problem is solved from the measured state, warm started by the last plan
    shifted to now (states, controls and costates), and its first control applied. An input is
    always finite and within its bounds. Where the new plan cannot be used, the next rung of
    this ladder is taken, and the decision says so:

    1. the new plan, ``OPTIMAL``; with ``real_time`` a prepared one, corrected, ``REAL_TIME``; where
       the solver stopped early ``FEASIBLE``. The model is run under the controls of these two,
       and must meet the constraints;
    2. the remainder of the last good plan, ``SHIFTED``, run on the model from the measured
       state: it must meet the constraints;
    3. where no plan meets the constraints, the new plan that violates those on states least,
       ``LEAST_VIOLATING``, within all limits of the input; the message says by how much and where;
    4. the ``backup`` law, ``BACKUP``;
    5. ``ControlRefused``.

    A measurement that is not finite, or absurd (1e8 sizes of its state), counts as missing. A
    solver that raised is built again before the next step. A callback may raise anything.

    After two runs of the solver in a row without a plan that meets the constraints, every other one
    starts cold, as the first step does, since the last plan may mislead it.

    Of several threads that ask for a step each waits for the one before. A copy, also in another
    process, is built from the options again and goes on from a copy of ``state``; what the
    solver's program keeps from its runs stays behind.

    A plan that took longer than ``budget`` is too late for its step: it is not applied, but kept
    as the last plan of later steps. Source: thesis Algorithm 3,
    2.2.1; [Mayne et al. 2000].

    Args:
        ocp: the problem over one horizon. Its t is absolute time: t0 enters at every step.
        solver: any solver. Where it, or one inside it, has a ``time_limit`` and leaves it open, a
            run gets 10 s, so that the loop goes on where third-party code does not return.
        dt: sampling interval [s]; need not divide the horizon, since a shifted plan is
            interpolated. For a discrete-time model it is that model's step. The input is held
            for dt: plans whose controls are held for less are applied only in their first part.
        applied: what the plant receives.
        backup: (x, t) -> input (m,); ``"default"``: ``saturated_lqr`` where the problem is
            linear-quadratic, ``instantaneous`` where it is that of a redundant arm, else
            ``"hold"``: the last input; None: refuse. ``backup_law`` says which is in force.
        parameters: t -> parameters and signals of the horizon that starts there. If it raises,
            or what it returns does not fit, at the first step that is an error; later there
            is no new plan, and the last one is judged by the parameters it was made with.
        guess: where the first step starts; a ``Solution`` of any solver. Indirect shooting
            needs a good one: from its own it may converge to a spurious extremal and stay there.
        delay: time from measurement to effect [s], a multiple of dt.
        compensate: whether the state is predicted over the delay, with the inputs that are
            already on their way; if not, the plan starts from the measured state.
        least_violating: whether the plan that violates the constraints least is followed where no
            plan meets them. A step that needs it takes a second run of the solver.
        budget: time for a step [s]; None: unlimited.
        tolerance: by how much an input may leave its bounds, or a plan the constraints, before
            that is a failure, in the sizes of the rows where the problem is scaled; an input that
            leaves them by less is clipped, and it is recorded.
        real_time: whether the rest of each interval prepares the next step: see ``prepare_next``.
            Only solvers that can: ``MultipleShooting(backend="native")``.
        compiled: whether the solver, where it has such an option, and the model run as machine
            code. The first build takes seconds; see ``compiled``.

    Attributes:
        backup_law: the law in force, and why the problem suggests no other.
        state: what is known from earlier steps; it may be kept and set again.

    Raises:
        ProblemError: if interval, delay, budget, backup or bounds do not fit the problem.
        UnsupportedProblem: if the solver cannot treat it, its start is free (here it is
            measured), or its final time is.
    """

    ocp: OCP
    solver: Solver
    dt: float
    applied: PlantInput = field(default_factory=PlantInput)
    backup: BackupOption = "default"
    parameters: Parameters | None = None
    guess: InitialGuess | None = None
    delay: float = 0.0
    compensate: bool = True
    least_violating: bool = True
    budget: float | None = None
    tolerance: float = 1e-6
    real_time: bool = False
    compiled: bool = True
    # Built from the options above.
    backup_law: Backup = field(init=False)
    _ladder: FallbackLadder = field(init=False, repr=False)
    # The only part that a step changes.
    state: ControllerState = field(init=False, repr=False)
    # A step takes the state that the step before it has left.
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)
    # The thread that is inside a step.
    _inside: int | None = field(default=None, init=False, repr=False)

    def __repr__(self) -> str:
        """Return one line: of what, by what, how often, and what it falls back on."""
        late = f", delay {self.delay:g} s" if self.delay else ""
        by = f"{type(self.solver).__name__}, dt = {self.dt:g} s{late}"
        return f"<MPC of '{self.ocp.name}' by {by}, backup_law={self.backup_law}>"

    def __post_init__(self) -> None:
        """Check the options, do all symbolic work, and begin without a plan."""
        self._check()
        self.backup_law = select_backup(self.backup, self.ocp, self.dt, self.applied)
        self._begin(None, solver_raised=False)
        self._ladder = self._built()

    def __reduce__(self) -> tuple[Callable[..., "MPC"], tuple[type["MPC"], dict[str, Any], Any]]:
        """Copy and pickle options and ``state``; the copy builds its own solver."""
        options = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        return _copied, (type(self), options, self.state)

    def _built(self) -> FallbackLadder:
        solver = self.solver.for_control_loop(compiled=self.compiled, time_limit=_TIME_LIMIT)
        program = solver.build(self.ocp)
        if self.real_time and (why := why_no_feedback(program)):
            raise UnsupportedProblem(
                f"MPC of {self.ocp.name}: {self.solver!r} prepares no real-time iterations: {why}, "
                "or leave real_time out"
            )
        ladder = FallbackLadder(
            ocp=self.ocp,
            program=program,
            least=solver.least_violating(self.ocp) if self.least_violating else None,
            imposed=replace(solver.imposed(self.ocp), sizes=row_sizes(self.ocp)),
            dt=self.dt,
            applied=self.applied,
            backup=self.backup_law,
            parameters=self.parameters,
            guess=self.guess,
            delay=self.delay,
            compensate=self.compensate,
            budget=inf if self.budget is None else self.budget,
            tolerance=self.tolerance,
            compiled=self.compiled,
            real_time=self.real_time,
        )
        ladder.prepare()
        return ladder

    def _check(self) -> None:
        check_instance(self.ocp, OCP, "MPC: ocp")
        check_instance(self.solver, Solver, "MPC: solver")
        check_instance(self.applied, PlantInput, "MPC: applied")
        if self.parameters is not None:
            check_callable(self.parameters, "MPC: parameters")
        self.ocp.first_guess(self.guess)
        name, model, dt = self.ocp.name, self.ocp.model, self.dt
        if self.ocp.has_free_time:
            raise UnsupportedProblem(f"MPC of {name}: the final time is free, a horizon is needed")
        if self.ocp.has_free_start:
            raise UnsupportedProblem(f"MPC of {name}: its start is free, here it is measured")
        refuse_terms_of_one_horizon(self.ocp, self.applied)
        check_positive(dt, f"MPC of {name}: dt [s]")
        if model.dt is not None and abs(dt - model.dt) > 1e-9 * model.dt:
            raise ProblemError(f"MPC of {name}: dt = {dt} s, but the model's step is {model.dt} s")
        if dt > self.ocp.duration * (1.0 + 1e-9):
            raise ProblemError(
                f"MPC of {name}: dt = {dt} s is longer than the horizon of {self.ocp.duration} s"
            )
        if self.budget is not None:
            check_positive(self.budget, f"MPC of {name}: budget [s]", finite=False)
        check_not_negative(self.tolerance, f"MPC of {name}: tolerance", finite=False)
        check_flag(self.least_violating, f"MPC of {name}: least_violating")
        check_flag(self.real_time, f"MPC of {name}: real_time")

    @property
    def is_stateful(self) -> bool:
        """Whether a solution depends on the solver's earlier runs, other than by the guess."""
        return self._ladder.program.is_stateful

    def reset(self, acting: ArrayLike | None = None) -> None:
        """Forget the last plan and input.

        Args:
            acting: input that acts until the first decision does (m,), so that a delay is
                compensated from the first step on; None: nothing is known of it.
        """
        size = self.applied.size(self.ocp)
        first = None if acting is None else check_numbers(acting, size, "MPC: acting input")
        self._alone(lambda: self._begin(first, solver_raised=self.state.solver_raised))

    def _begin(self, acting: np.ndarray | None, *, solver_raised: bool) -> None:
        begun = ControllerState.at_start(delay_steps(self.delay, self.dt), acting)
        self.state = begun._replace(solver_raised=solver_raised)

    def step(
        self,
        x: ArrayLike,
        t: float,
        *,
        late: bool | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
    ) -> Decision:
        """Decide.

        Args:
            x: measured state (nx,); NaN is a missing measurement.
            t: when it was measured [s].
            late: whether the new plan is late for this step; default: by the clock and ``budget``.
            parameters: of the horizon that starts when the input acts, by name; default: what
                the controller's own ``parameters`` say.

        Raises:
            ProblemError: if x has a wrong shape, t is not finite, or the parameters do not fit.
            ControlRefused: if no rung holds.
        """

        def decide() -> StepReport:
            started = perf_counter()
            broken = self._rebuild() if self.state.solver_raised else ""
            report, self.state = self._ladder.step(
                self.state, x, t, late=late, parameters=parameters, started=started, broken=broken
            )
            return report

        report = self._alone(decide)
        if not isinstance(report, Decision):
            raise ControlRefused(f"t = {t:g} s: {report.message}", report)
        return report

    def prepare_next(self, *, parameters: Mapping[str, ArrayLike] | None = None) -> bool:
        """Use the rest of an interval: solve for the state that the model expects at the next step.

        That step then only corrects this plan by what was measured: one real-time iteration, which
        differs from a solve by second-order terms in the distance of the two states. The ladder
        judges it like any plan that is not optimal: the model is run under its controls, and its
        states must be those of the plan to 2 %. Where it is not good enough, the step comes at
        another time or with other parameters, or nothing was prepared, the step solves as always.
        A rollout (``run``, ``closed_loop``) calls it after every step; who calls ``step`` calls it
        when the input has been sent.

        Args:
            parameters: of the horizon of the next step, by name; default: what the controller's
                own ``parameters`` say.

        Returns:
            whether the next step is prepared; False without ``real_time``.
        """
        if not self.real_time or self.state.solver_raised:
            return False
        return self._alone(lambda: self._ladder.prepare_step(self.state, parameters))

    def _rebuild(self) -> str:
        """Build the solver again; return why that fails, or nothing."""
        try:
            self._ladder = self._built()
        except CALLBACK_ERRORS as error:
            return f"the solver cannot be built again: {type(error).__name__}: {error}"
        return ""

    def _alone(self, act: Callable[[], T]) -> T:
        """Let one thread in at a time, and none twice.

        Raises:
            ProblemError: if a callback of a step calls the controller.
        """
        if self._inside == get_ident():
            raise ProblemError(
                f"MPC of {self.ocp.name}: step, reset or prepare_next is called inside a step: "
                "a callback of a controller cannot call it"
            )
        # The statement, not its methods: Ctrl-C does not come between lock and block.
        with self._lock:
            self._inside = get_ident()
            try:
                return act()
            finally:
                self._inside = None

    def run(
        self,
        plant: Plant,
        x0: ArrayLike,
        duration: float,
        *,
        seed: int = 0,
        watch: Observer | None = None,
        progress: Progress | None = None,
    ) -> Rollout:
        """Control a plant for a while [s]: ``closed_loop`` with the controller's own interval.

        Raises:
            ProblemError: if states or inputs of plant and problem differ in number.
            Interrupted: on Ctrl-C; its ``so_far`` is the rollout until then.
        """
        check_instance(plant, Plant, f"MPC of {self.ocp.name}: plant")
        for what, ours, theirs in (
            ("states", self.ocp.model.nx, plant.ocp.model.nx),
            ("inputs", self.applied.size(self.ocp), plant.ocp.model.nu),
        ):
            if ours != theirs:
                raise ProblemError(
                    f"MPC of {self.ocp.name}: {ours} {what}, but the plant '{plant.ocp.name}' "
                    f"has {theirs}"
                )
        return closed_loop(
            self, plant, x0, duration, dt=self.dt, seed=seed, watch=watch, progress=progress
        )


def _copied(kind: type[MPC], options: dict[str, Any], state: ControllerState) -> MPC:
    controller = kind(**options)
    controller.state = state
    return controller
