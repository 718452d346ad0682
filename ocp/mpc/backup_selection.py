"""The backup law for steps without a usable plan: the user's, or what the problem suggests."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ocp.checks.errors import OCPError, ProblemError, UnsupportedProblem
from ocp.closed_loop.decision import ControlRefused
from ocp.closed_loop.guarded_call import ControlLaw, guarded_call
from ocp.mpc.backup_laws import ParametricLaw, instantaneous, saturated_lqr
from ocp.mpc.plant_input import PlantInput
from ocp.problem.ocp import OCP

# What a user may choose: a law, one of two words, or None: refuse.
BackupOption = ControlLaw | Literal["default", "hold"] | None
# (x, t, p) -> input (m,).
BackupFunction = Callable[[np.ndarray, float, np.ndarray], ArrayLike]

# States at which the directions that the control moves are counted, and how far apart [x].
_PROBES, _SPREAD = 3, 0.1
# Relative to the largest one, a smaller singular value is zero.
_RANK = 1e-9
# What a law raises that does not fit a problem, or whose numbers do not work out.
_NOT_THIS_ONE = (OCPError, ArithmeticError, ValueError, RuntimeError)


@dataclass(frozen=True, eq=False)
class Backup:
    """The last rung of the ladder.

    Attributes:
        name: of the law, in words.
        law: (x, t, p) -> input (m,); None: there is none.
        holds: whether the last input is held where there is no law, or it fails.
        why: why the problem suggests no law, or not the first one.
    """

    name: str
    law: BackupFunction | None
    holds: bool
    why: str = ""

    def input(
        self, x: np.ndarray, t: float, p: np.ndarray, *, size: int, last: np.ndarray | None
    ) -> tuple[np.ndarray | None, str]:
        """Return the input of the law, or the last one where it is held; None, and why.

        Args:
            x: state (nx,).
            t: time [s].
            p: parameters at that time (n_p,).
            size: of the input, m.
            last: the last input (m,), if there is one.
        """
        given, reason = (None, "") if self.law is None else self._by_law(self.law, x, t, p, size)
        if given is not None or not self.holds:
            return given, reason or "there is no backup law"
        end = "there is no input to hold" if last is None else "backup: hold"
        return last, f"{reason}; {end}" if reason else end

    def _by_law(
        self, law: BackupFunction, x: np.ndarray, t: float, p: np.ndarray, size: int
    ) -> tuple[np.ndarray | None, str]:
        try:
            given = guarded_call(lambda x, t: law(x, t, p), "the backup law", x, t)
        except ControlRefused as refusal:
            return None, str(refusal)
        if len(given) != size:
            return None, f"the backup law returned {len(given)} numbers, not {size}"
        return given, f"backup: {self.name}"

    def __repr__(self) -> str:
        """Name the law, and what else was tried."""
        return f"Backup({self.name}{': ' + self.why if self.why else ''})"


def select_backup(choice: BackupOption, ocp: OCP, dt: float, applied: PlantInput) -> Backup:
    """Return the backup law in force.

    Args:
        choice: ``"default"``: what the problem suggests; ``"hold"``: the last input; None: none,
            the controller refuses; or a law (x, t) -> input (m,).
        ocp: the problem.
        dt: sampling interval [s].
        applied: what the plant receives.

    Raises:
        ProblemError: if the choice is nothing of that kind.
    """
    if callable(choice):
        return Backup("the user's law", lambda x, t, p: choice(x, t), holds=False)
    if choice is None:
        return Backup("none", None, holds=False)
    if isinstance(choice, str) and choice == "hold":
        return Backup("hold", None, holds=True)
    if isinstance(choice, str) and choice == "default":
        return suggest_backup(ocp, dt, applied)
    raise ProblemError(
        f"{ocp.name}: backup = {choice!r} is neither a law (x, t) -> input nor default, hold, None"
    )


def suggest_backup(ocp: OCP, dt: float, applied: PlantInput) -> Backup:
    """Return the law that fits what the problem is; where none can be built, hold.

    Linear dynamics and a quadratic cost: the saturated regulator. A redundant arm, told by its
    dynamics: instantaneous control, which is prioritised kinematics. In all else the last input
    is held. Both laws know the parameters of the instant, and no constraint but control bounds.
    """
    refused = []
    for name, build in _SUGGESTIONS:
        try:
            law = build(ocp, dt)
        except _NOT_THIS_ONE as error:
            refused.append(f"no {name}: {error}")
        else:
            return Backup(name, _sent(law, ocp, applied), True, "; ".join(refused))
    return Backup("hold", None, True, "; ".join(refused))


def _regulator(ocp: OCP, dt: float) -> ParametricLaw:
    law = saturated_lqr(ocp, dt=None if ocp.model.is_discrete else dt)
    _refuse_blind(ocp)
    return law


def _kinematics(ocp: OCP, dt: float) -> ParametricLaw:
    if not is_redundant(ocp):
        raise UnsupportedProblem(f"{ocp.name}: the control does not move what a task leaves free")
    _refuse_blind(ocp)
    return instantaneous(ocp)


def _refuse_blind(ocp: OCP) -> None:
    """Refuse a law that follows the running cost where that does not see what is limited.

    A cost sees the states in it, and those that move what it sees. A price of the heating alone
    sees no temperature: the law that minimises it lets the room freeze.
    """
    ocp = ocp.explicit
    m = ocp.model
    moved = np.array(ca.DM(ca.jacobian_sparsity(m.f, m.x), 1.0)) > 0.0
    seen = _contained(ca.SX(ocp.running_cost), m.x)
    for _ in range(m.nx):
        seen = seen | moved[seen].any(axis=0)
    box = ocp.state_bounds
    limited = np.isfinite(np.asarray(box.lower)) | np.isfinite(np.asarray(box.upper))
    for c in ocp.constraints:
        limited = limited | _contained(c.expression, m.x)
    blind = limited & ~seen
    if blind.any() or not seen.any():
        names = ", ".join(n for n, on in zip(m.x_names, blind, strict=True) if on) or "state"
        raise UnsupportedProblem(f"{ocp.name}: the running cost sees no {names}")


def _contained(expression: ca.SX, symbols: ca.SX) -> np.ndarray:
    """Return which symbols an expression contains, bool (n,)."""
    return np.array(ca.which_depends(expression, symbols, 1, False), dtype=bool)


_SUGGESTIONS: tuple[tuple[str, Callable[[OCP, float], ParametricLaw]], ...] = (
    ("saturated regulator", _regulator),
    ("instantaneous control", _kinematics),
)


def _sent(law: ParametricLaw, ocp: OCP, applied: PlantInput) -> BackupFunction:
    """Return what the plant receives for the controls of a law."""
    input_of = applied.sending(ocp)
    return lambda x, t, p: input_of(x, law(x, t, p), t, p)


def is_redundant(ocp: OCP) -> bool:
    r"""Return whether a control resolves the redundancy of a task that the dynamics keep.

    .. math:: c_x f_u = 0, \qquad \mathrm{rank}\, c_x + \mathrm{rank}\, f_u = n_x, \quad
              0 < \mathrm{rank}\, c_x < n_x

    c(x, t) are the invariants: whatever the control does, they stay, and it moves the state in
    every direction that they leave free. So it is for the null-space form of an arm, thesis
    (3.17), not for a body whose invariant is the norm of its quaternion. Counted in numbers at
    the start and near it: the products of a pseudoinverse do not cancel symbolically.
    """
    ocp = ocp.explicit
    m = ocp.model
    if m.is_discrete or not ocp.invariants:
        return False
    task = ca.vertcat(*[c.expression for c in ocp.invariants])
    slopes = ca.Function(
        "slopes", [m.x, m.u, m.t, ocp.p], [ca.jacobian(task, m.x), ca.jacobian(m.f, m.u)]
    )
    p, rng = ocp.parameter_values().at(0.0)[0], np.random.default_rng(0)
    for k in range(_PROBES):
        x = ocp.start() + (k > 0) * _SPREAD * rng.normal(size=m.nx)
        c_x, f_u = (np.array(slope) for slope in slopes(x, rng.normal(size=m.nu), 0.0, p))
        if not (np.isfinite(c_x).all() and np.isfinite(f_u).all()):
            return False
        kept, moved = _rank(c_x), _rank(f_u)
        moves_task = np.abs(c_x @ f_u).max() > _RANK * np.abs(c_x).max() * np.abs(f_u).max()
        if moves_task or kept + moved != m.nx or not 0 < kept < m.nx:
            return False
    return True


def _rank(matrix: np.ndarray) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int((values > _RANK * values[0]).sum()) if values.size else 0
