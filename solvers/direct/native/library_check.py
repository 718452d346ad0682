"""The compiled functions of all nodes against CasADi at one point: compilers make mistakes."""

from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np

from solvers.direct.native.native_arrays import NativeArrays
from solvers.direct.native.stage_code import StageCode

# By how much compiled numbers may differ, relative to 1 + abs(value).
_SAME = 1e-6
# A state that is moved further by one interval has exploded.
_TAME = 1e3


def first_difference(
    code: StageCode,
    at: NativeArrays,
    evaluate: Callable[[int], float],
    account: Callable[[], object],
) -> str | None:
    """Return what differs first, at a random point of every node, and so of every lane; None: none.

    Args:
        code: what was compiled.
        at: its memory, which is written to.
        evaluate: evaluates up to derivatives of an order, and returns the cost.
        account: says what the iterate is worth, half steps among it.
    """
    rng = np.random.default_rng(0)
    for array in (at.x, at.u, at.data, at.costate, at.y):
        array[:] = rng.uniform(0.5, 1.5, size=array.shape)
    known = _known(code, at)
    for order, names in enumerate((("gap", "v"), ("slope", "gradient", "c_slope"), ("hessian",))):
        made = {n: getattr(at, n) for group in (("gap", "v"), names) for n in group}
        for array in made.values():
            array[:] = np.nan
        cost = np.array([evaluate(order)])
        for name, found in {"cost": cost, **made}.items():
            if not _is_same(found, known[name]):
                return f"{name}, at order {order}"
    at.sizes[:], at.half_step[:] = 1.0, np.nan
    account()
    # At a random point some stages explode, and twice as many steps on the way keep no digit.
    tame = np.where(np.abs(known["half_step"]) < _TAME, known["half_step"], np.nan)
    return None if _is_same(at.half_step, tame) else "the half step"


def _is_same(found: np.ndarray, right: np.ndarray) -> bool:
    """Whether numbers agree where the right ones are finite."""
    known = np.isfinite(right)
    found, right = found[known], right[known]
    return bool((np.abs(found - right) <= _SAME * (1.0 + np.abs(right))).all())


def _known(code: StageCode, at: NativeArrays) -> dict[str, np.ndarray]:
    """Return what CasADi makes of the iterate, under the names of the arrays, and the cost."""
    n, nb = code.transcription.n, len(code.bounded)
    known = {
        name: np.zeros(getattr(at, name).shape)
        for name in ("gap", "v", "slope", "gradient", "hessian", "c_slope", "half_step")
    }
    known["cost"] = np.zeros(1)
    flat, row = 0, 0
    for k in range(n + 1):
        w = np.concatenate([at.u[k] if k < n else np.zeros(code.nu), at.x[k]])
        known["v"][flat : flat + nb] = w[list(code.bounded)]
        flat += nb
        for each in _functions(code, at, k, flat):
            count = len(each["rows"])
            known["v"][flat : flat + count] = each["rows"]
            known["c_slope"][row : row + count] = each["c_slope"]
            known["hessian"][k] += each["hessian"]
            flat, row = flat + count, row + count
            if "cost" in each:
                known["cost"] += each["cost"]
                known["gradient"][k] = each["gradient"]
            if "next" in each:
                known["gap"][k] = each["next"] - at.x[k + 1]
                known["slope"][k] = each["slope"]
                known["half_step"][k] = each["half_step"] - at.x[k + 1]
    return known


def _functions(
    code: StageCode, at: NativeArrays, k: int, flat: int
) -> Iterator[dict[str, np.ndarray]]:
    """Yield what the functions of node k return, by name; its rows begin at ``flat``."""
    full = {f.name(): f for f in code.functions}
    n, (nc, ni, ne), x, d = code.transcription.n, code.row_counts, at.x[k], at.data[k]
    if k == n:
        numbers = full["end_full"].call([x, d, at.y[flat : flat + ne]])
        yield _named(("cost", "rows", "gradient", "c_slope", "hessian"), numbers)
        return
    given = [x, at.u[k], d, at.costate[k + 1], at.y[flat : flat + nc]]
    names = ("next", "cost", "rows", "slope", "gradient", "c_slope", "hessian")
    half_step = np.ravel(np.array(full["stage_half"](x, at.u[k], d)))
    yield _named(names, full["stage_full"].call(given)) | {"half_step": half_step}
    if k == 0:
        numbers = full["start_full"].call([x, d, at.y[flat + nc : flat + nc + ni]])
        yield _named(("rows", "c_slope", "hessian"), numbers)


def _named(names: tuple[str, ...], numbers: list[ca.DM]) -> dict[str, np.ndarray]:
    """Return values by name: slopes a row each, everything else but Hessians flat."""
    shapes = {"slope": np.transpose, "c_slope": np.transpose, "hessian": np.asarray}
    return {
        name: shapes.get(name, np.ravel)(np.array(value))
        for name, value in zip(names, numbers, strict=True)
    }
