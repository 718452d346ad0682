"""Which row of a nonlinear program is violated most."""

from collections.abc import Callable, Sequence

import numpy as np

from ocp.problem.constraint_rows import ConstraintRow


def most_violated(
    w: np.ndarray,
    g: np.ndarray,
    bounds: dict[str, np.ndarray],
    rows: Sequence[ConstraintRow],
    bound: Callable[[int], ConstraintRow],
) -> tuple[float, ConstraintRow | None]:
    """Return the largest violation of any row or bound, and which it is; 0 and None if none is.

    What is no number violates by inf.

    Args:
        w: unknowns (size,).
        g: values of the rows (m,).
        bounds: lbx and ubx (size,), lbg and ubg (m,).
        rows: what each value of g says.
        bound: what the bound of the i-th unknown says.
    """
    in_g = np.maximum(bounds["lbg"] - g, g - bounds["ubg"])
    in_w = np.maximum(bounds["lbx"] - w, w - bounds["ubx"])
    in_g, in_w = (np.where(np.isnan(each), np.inf, each) for each in (in_g, in_w))
    if max(in_g.max(initial=0.0), in_w.max(initial=0.0)) <= 0.0:
        return 0.0, None
    if in_g.max(initial=0.0) >= in_w.max():
        return float(in_g.max()), rows[int(in_g.argmax())]
    return float(in_w.max()), bound(int(in_w.argmax()))
