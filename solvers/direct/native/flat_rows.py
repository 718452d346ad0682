"""Where the unknowns and rows of a transcribed problem stand in the arrays of the native solver."""

from dataclasses import dataclass

import numpy as np

from solvers.direct.native.native_library import NativeArrays
from solvers.direct.native.stage_code import StageCode


@dataclass(frozen=True, eq=False)
class FlatRows:
    """The two orders, and the way between them.

    The solver keeps, node by node, the entries of (u, x) that may have a bound and then the rows;
    the program keeps bounds of the unknowns (x, u) and rows apart, see ``Transcription``.

    Attributes:
        in_unknowns: of every flat entry its place among the unknowns, or -1.
        in_rows: of every flat entry its place among the rows of g, or -1.
        gaps: places of the gaps among the rows of g, (N, nx).
        x: places of x among the unknowns, (N + 1, nx).
        u: places of u among the unknowns, (N, nu).
    """

    in_unknowns: np.ndarray
    in_rows: np.ndarray
    gaps: np.ndarray
    x: np.ndarray
    u: np.ndarray

    @classmethod
    def of(cls, code: StageCode) -> "FlatRows":
        """Count them off."""
        tr, n, nx, nu = code.transcription, code.transcription.n, code.nx, code.nu
        nc, ni, ne = code.row_counts
        places = np.arange(tr.size)
        x, u = (part.astype(int) for part in tr.split(places.astype(float)))
        w = np.hstack([np.vstack([u, np.full((1, nu), -1)]), x])
        unknowns, rows, gaps, at = [], [], [], 0
        for k in range(n + 1):
            if k < n:
                gaps.append(np.arange(at, at + nx))
                at += nx
            count = ne if k == n else nc + ni if k == 0 else nc
            unknowns += [*w[k, list(code.bounded)], *[-1] * count]
            rows += [*[-1] * len(code.bounded), *range(at, at + count)]
            at += count
        return cls(np.array(unknowns, dtype=int), np.array(rows, dtype=int), np.array(gaps), x, u)

    def put_bounds(self, at: NativeArrays, bounds: dict[str, np.ndarray]) -> None:
        """Write bounds lbx, ubx, lbg, ubg into the arrays; equal ones of x_0 and u are given."""
        given = bounds["lbx"] == bounds["ubx"]
        at.x_given[:] = given[self.x[0]]
        at.u_given[:] = given[self.u]
        of_unknowns, of_rows = self.in_unknowns >= 0, self.in_rows >= 0
        for side, free, x, g in (
            (at.low, -np.inf, "lbx", "lbg"),
            (at.up, np.inf, "ubx", "ubg"),
        ):
            side[:] = free
            side[of_unknowns] = bounds[x][self.in_unknowns[of_unknowns]]
            side[of_rows] = bounds[g][self.in_rows[of_rows]]

    def values(self, at: NativeArrays) -> np.ndarray:
        """Return the rows g."""
        g = np.zeros(self.gaps.size + np.count_nonzero(self.in_rows >= 0))
        g[self.gaps] = -at.gap
        of_rows = self.in_rows >= 0
        g[self.in_rows[of_rows]] = at.v[of_rows]
        return g

    def lam_g(self, at: NativeArrays) -> np.ndarray:
        """Return the multipliers of the rows g; of the gaps minus the costates."""
        result = np.zeros(self.gaps.size + np.count_nonzero(self.in_rows >= 0))
        result[self.gaps] = -at.costate[1:]
        of_rows = self.in_rows >= 0
        result[self.in_rows[of_rows]] = (at.z_up - at.z_low + at.y)[of_rows]
        return result

    def multipliers_of_bounds(self, at: NativeArrays, gradient: np.ndarray) -> np.ndarray:
        """Return the multipliers of the bounds; of what is given, what balances the gradient.

        Args:
            at: the arrays.
            gradient: of the Lagrangian without those, (N + 1, nu + nx) in (u, x).
        """
        result = np.zeros(self.x.size + self.u.size)
        chosen = self.in_unknowns >= 0
        result[self.in_unknowns[chosen]] = (at.z_up - at.z_low + at.y)[chosen]
        nu = self.u.shape[1]
        result[self.u] = np.where(at.u_given != 0.0, -gradient[:-1, :nu], result[self.u])
        first = self.x[0]
        result[first] = np.where(at.x_given != 0.0, -gradient[0, nu:], result[first])
        return result
