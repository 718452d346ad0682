"""Random small loops on their nominal plants: whenever the solver says SOLVED, its plan acts."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp import (
    MPC,
    OCP,
    Box,
    Constraint,
    Decision,
    InputSource,
    Model,
    Plant,
    Rate,
    Rollout,
    Solver,
    Status,
    UnsupportedProblem,
    discretise,
)
from solvers import Collocation, LinearMPC, MultipleShooting, StagewiseNewton

_DT, _STEPS, _LOOP = 0.1, 10, 6
# What makes the problems of this kind: each is there or not, by lot.
FEATURES = ("soft limits", "slack", "rate", "price", "moving bound", "hard limits", "units")


@dataclass(frozen=True)
class FollowedLoop:
    """One random problem in a loop.

    Attributes:
        features: of ``FEATURES``.
        solver: as text.
        steps: in all.
        solved: steps whose solver said SOLVED.
        followed: those of them whose plan acted.
        outside: steps whose input left a row that limits it.
        reason: why the first plan that was not followed was not.
    """

    features: tuple[str, ...]
    solver: str
    steps: int
    solved: int
    followed: int
    outside: int
    reason: str

    @property
    def is_good(self) -> bool:
        """Whether every solved plan was followed, within every limit."""
        return self.followed == self.solved and not self.outside


def random_loops(count: int, *, seed: int = 0) -> Iterator[FollowedLoop]:
    """Yield loops of random problems of at most three states, each by a random solver that fits.

    Args:
        count: how many.
        seed: of the first; the others have the next ones.
    """
    for k in range(count):
        yield _loop(np.random.default_rng(seed + k))


def _loop(rng: np.random.Generator) -> FollowedLoop:
    while True:
        features = tuple(name for name in FEATURES if rng.random() < 0.4)
        ocp = _problem(rng, features)
        solver = _solver(rng, ocp, features)
        try:
            mpc = MPC(ocp=ocp, solver=solver, dt=_DT, backup="hold")
        except UnsupportedProblem:  # say, a price without curvature for LinearMPC
            continue
        break
    rollout = mpc.run(Plant(ocp=ocp, substeps=8), ocp.start(), _LOOP * _DT)
    solved = [d for d in rollout.decisions if d.status is Status.SOLVED]
    missed = [d for d in solved if d.source is not InputSource.OPTIMAL]
    return FollowedLoop(
        features=features,
        solver=repr(solver),
        steps=len(rollout.decisions),
        solved=len(solved),
        followed=len(solved) - len(missed),
        outside=sum(
            outside_limits(ocp, x, d, last) > 1e-9
            for x, d, last in zip(rollout.x, rollout.decisions, before(rollout), strict=False)
        ),
        reason=missed[0].message if missed else rollout.ended,
    )


def before(rollout: Rollout) -> list[np.ndarray | None]:
    """Return what was decided before each decision of a loop; None before the first."""
    return [None, *(d.input for d in rollout.decisions)]


def outside_limits(ocp: OCP, x: np.ndarray, decision: Decision, last: np.ndarray | None) -> float:
    """Return by how much an input leaves the rows that limit it; parameters are as declared.

    Args:
        ocp: in discrete time, where it limits rates.
        x: state when the input acts (nx,).
        decision: with the input.
        last: the input before; None: as declared.
    """
    rows, rates = ocp.rows.controls + ocp.rows.path.of_kind("input"), ocp.control_rates
    m, p, u = ocp.model, ocp.parameter_values().at(0.0)[0], decision.input
    values = ca.Function("limits", [m.x, m.u, m.t, ocp.p], [ca.densify(rows.expression)])
    excess = rows.excess(np.array(values(x, u, decision.applies_at, p)).ravel())
    from_there = ocp.last_input if last is None else last[rates.index]
    change = u[rates.index] - np.asarray(from_there) if len(rates) else np.empty(0)
    return float(max(excess.max(initial=0.0), rates.box.excess(change).max(initial=0.0)))


def _problem(rng: np.random.Generator, features: tuple[str, ...]) -> OCP:
    """Return a random stable or mildly unstable linear problem with these features."""
    nx = int(rng.integers(1, 4))
    x, u, t = ca.SX.sym("x", nx), ca.SX.sym("u"), ca.SX.sym("t")
    a = rng.normal(size=(nx, nx)) - np.eye(nx)
    b = rng.normal(size=(nx, 1)) + np.sign(rng.normal(size=(nx, 1)))
    start = rng.uniform(-1.0, 1.0, nx)
    units = 10.0 ** rng.uniform(-4, 4, nx) if "units" in features else np.ones(nx)
    own = x / ca.DM(units)
    weight = float(10.0 ** rng.uniform(-2, 1))
    cost = ca.sumsqr(own) + weight * u**2
    if "price" in features:
        cost += float(rng.uniform(0.1, 2.0)) * u
    constraints: list[Constraint] = []
    if "moving bound" in features:
        bound = 1.0 + 0.5 * ca.sin(float(rng.uniform(1, 9)) * t)
        constraints.append(Constraint("supply", u - bound, upper=0.0))
    reach = 1.5 * np.abs(start).max() + 0.5
    is_limited = bool({"hard limits", "soft limits"} & set(features))
    limits = Box(-reach * units, reach * units) if is_limited else Box()
    rate = ca.DM(units) * (ca.DM(a) @ own + ca.DM(b) @ u)
    ocp = OCP(
        name="random",
        model=Model(name="random", x=x, u=u, t=t, f=rate),
        x0=start * units,
        horizon=_STEPS * _DT,
        running_cost=cost,
        control_bounds=Box(-2.0, 2.0),
        state_bounds=limits,
        constraints=tuple(constraints),
    )
    if "slack" in features:
        ocp = _with_slack(ocp, own[0], float(rng.uniform(0.2, 0.8)) * reach)
    if "rate" in features or rng.random() < 0.5:
        ocp = discretise(ocp, _DT)
    if "rate" in features:
        slowest = -float(rng.uniform(0.2, 1.0))
        ocp = replace(ocp, rates=(Rate(u, slowest, 1.0, weight=0.01),), last_input=[0.0])
    return ocp


def _with_slack(ocp: OCP, soft: ca.SX, limit: float) -> OCP:
    """Limit an expression softly, by a control that has no other use."""
    m, slack = ocp.model, ca.SX.sym("slack")
    box = ocp.control_bounds
    return replace(
        ocp,
        model=replace(m, u=ca.vertcat(m.u, slack)),
        running_cost=ca.SX(ocp.running_cost) + 10.0 * slack + 10.0 * slack**2,
        control_bounds=Box(np.append(box.lower, 0.0), np.append(box.upper, np.inf)),
        constraints=(*ocp.constraints, Constraint("comfort", soft - slack, upper=limit)),
    )


def _solver(rng: np.random.Generator, ocp: OCP, features: tuple[str, ...]) -> Solver:
    if "soft limits" in features and ocp.model.is_discrete:
        return LinearMPC(soft=1e3)
    kinds: list[Solver] = [
        MultipleShooting(_STEPS),
        MultipleShooting(_STEPS, backend="fatrop"),
    ]
    if ocp.model.is_discrete:
        kinds += [LinearMPC(), LinearMPC("clarabel"), LinearMPC(form="condensed")]
    else:
        kinds.append(Collocation(_STEPS // 2, degree=3))
    if not ocp.constraints and not ocp.state_bounds.is_active:
        kinds.append(StagewiseNewton(_STEPS))
    return kinds[int(rng.integers(len(kinds)))]
