"""Where the unknowns and rows of a transcribed problem stand in the arrays of the native solver."""

from dataclasses import dataclass

import numpy as np

from solvers.direct.native.native_arrays import NativeArrays
from solvers.direct.native.stage_code import StageCode


@dataclass(frozen=True, eq=False)
class FlatRows:
    """The two orders, and the way between them.

    The solver keeps, node by node, the entries of (u, x) that may have a bound and then the rows;
    the program keeps bounds of the unknowns (x, u) and rows apart, see ``Transcription``.

    Attributes:
        bounded: the flat entries that are unknowns.
        in_unknowns: their places among the unknowns.
        rows: the flat entries that are rows.
        in_rows: their places among the rows of g.
        gaps: places of the gaps among the rows of g, (N, nx).
        x: places of x among the unknowns, (N + 1, nx).
        u: places of u among the unknowns, (N, nu).
    """

    bounded: np.ndarray
    in_unknowns: np.ndarray
    rows: np.ndarray
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
        places = (np.array(each, dtype=int) for each in (unknowns, rows))
        (bounded, in_unknowns), (flat, in_rows) = (
            (chosen := np.flatnonzero(each >= 0), each[chosen]) for each in places
        )
        return cls(bounded, in_unknowns, flat, in_rows, np.array(gaps), x, u)

    def put_bounds(self, at: NativeArrays, bounds: dict[str, np.ndarray]) -> None:
        """Write bounds lbx, ubx, lbg, ubg into the arrays; equal ones of x_0 and u are given."""
        given = bounds["lbx"] == bounds["ubx"]
        at.x_given[:] = given[self.x[0]]
        at.u_given[:] = given[self.u]
        for side, free, x, g in (
            (at.low, -np.inf, "lbx", "lbg"),
            (at.up, np.inf, "ubx", "ubg"),
        ):
            side[:] = free
            side[self.bounded] = bounds[x][self.in_unknowns]
            side[self.rows] = bounds[g][self.in_rows]

    def values(self, at: NativeArrays) -> np.ndarray:
        """Return the rows g."""
        g = np.empty(self.gaps.size + self.rows.size)
        g[self.gaps] = -at.gap
        g[self.in_rows] = at.v[self.rows]
        return g

    def lam_g(self, at: NativeArrays) -> np.ndarray:
        """Return the multipliers of the rows g; of the gaps minus the costates."""
        result = np.empty(self.gaps.size + self.rows.size)
        result[self.gaps] = -at.costate[1:]
        result[self.in_rows] = (at.z_up - at.z_low + at.y)[self.rows]
        return result

    def multipliers_of_bounds(self, at: NativeArrays, gradient: np.ndarray) -> np.ndarray:
        """Return the multipliers of the bounds; of what is given, what balances the gradient.

        Args:
            at: the arrays.
            gradient: of the Lagrangian without those, (N + 1, nu + nx) in (u, x).
        """
        result = np.zeros(self.x.size + self.u.size)
        result[self.in_unknowns] = (at.z_up - at.z_low + at.y)[self.bounded]
        nu = self.u.shape[1]
        result[self.u] = np.where(at.u_given != 0.0, -gradient[:-1, :nu], result[self.u])
        first = self.x[0]
        result[first] = np.where(at.x_given != 0.0, -gradient[0, nu:], result[first])
        return result
