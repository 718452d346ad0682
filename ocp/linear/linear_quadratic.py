"""A linear-quadratic problem as arrays: sampled by one call on the data of a run."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.checks.errors import ProblemError
from ocp.linear.node_function import NodeFunction
from ocp.problem.constraint import Box
from ocp.problem.constraint_rows import ConstraintRow
from ocp.problem.ocp import OCP
from ocp.problem.run_data import RunData

# An eigenvalue this much below zero, relative to the largest one, is rounding.
_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class Matrices:
    """What multiplies states and controls, stage by stage.

    Attributes:
        A: (N, n, n).
        B: (N, n, m).
        Q: (N, n, n).
        S: (N, n, m).
        R: (N, m, m).
        P: terminal weight (n, n).
        D_x: constraint rows at nodes 0..N-1, states (N, rows, n).
        D_u: the same, controls (N, rows, m).
        D_f: constraint rows at node N (end rows, n).
    """

    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    S: np.ndarray
    R: np.ndarray
    P: np.ndarray
    D_x: np.ndarray
    D_u: np.ndarray
    D_f: np.ndarray

    @cached_property
    def weights(self) -> np.ndarray:
        """The blocks [[Q, S], [S', R]], (N, n + m, n + m)."""
        return np.block([[self.Q, self.S], [self.S.transpose(0, 2, 1), self.R]])

    @cached_property
    def D(self) -> np.ndarray:
        """The constraint rows [D_x, D_u] at nodes 0..N-1, (N, rows, n + m)."""
        return np.concatenate([self.D_x, self.D_u], axis=2)

    def indefinite(self) -> str | None:
        """Return which weight is not as (positive) definite as it must be, or None."""
        for name, array, strictly in (
            ("R", self.R, True),
            ("Q", self.Q, False),
            ("P", self.P[None], False),
            ("[Q S; S' R]", self.weights, False),
        ):
            values = np.linalg.eigvalsh(array)
            least, scale = values[:, 0], np.abs(values).max(initial=0.0)
            bad = least <= _ROUNDING * scale if strictly else least < -_ROUNDING * scale
            if bad.any():
                k = int(bad.argmax())
                at = f" at step {k}" if np.ptp(array, axis=0).any() else ""
                kind = "definite" if strictly else "semi-definite"
                return f"{name} is not positive {kind}{at}: it has the eigenvalue {least[k]:.6g}"
        return None


class LQData(NamedTuple):
    """The numbers of one run; the same ``matrices`` object as long as they do not change.

    Attributes:
        matrices: what multiplies states and controls.
        c: affine terms of the dynamics (N, n).
        qr: linear terms q and r of the cost (N, n + m), counted twice as all cross terms.
        constant: sum of the constant terms, the terminal one included.
        p: terminal linear term (n,).
        lower: bounds of the rows at nodes 0..N-1 (N, rows).
        upper: the same.
        lower_f: bounds of the rows at node N (end rows,).
        upper_f: the same.
    """

    matrices: Matrices
    c: np.ndarray
    qr: np.ndarray
    constant: float
    p: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    lower_f: np.ndarray
    upper_f: np.ndarray

    @property
    def q(self) -> np.ndarray:
        """Linear terms in the states, (N, n)."""
        return self.qr[:, : self.c.shape[1]]

    @property
    def r(self) -> np.ndarray:
        """Linear terms in the controls, (N, m)."""
        return self.qr[:, self.c.shape[1] :]


@dataclass(frozen=True, eq=False)
class LinearQuadratic:
    r"""A discrete-time problem with linear dynamics, linear constraints, convex quadratic cost.

    .. math::

        \min \; x_N'Px_N + 2p'x_N + \sum_{k=0}^{N-1}
            x_k'Q_kx_k + 2x_k'S_ku_k + u_k'R_ku_k + 2q_k'x_k + 2r_k'u_k + \text{const}

        x_{k+1} = A_kx_k + B_ku_k + c_k, \quad
        \underline d_k \le D_{x,k}x_k + D_{u,k}u_k \le \overline d_k, \quad
        \underline d_N \le D_fx_N \le \overline d_N

    The thesis' convention (2.1): no factor one half, so costates are 2 (P_k x_k + p_k). Path
    constraints, and boxes as unit rows, stand in one list of rows. A row without control says
    nothing at node 0, which is measured, and holds at node N as well.

    Attributes:
        ocp: the problem.
        rows: what each row at nodes 0..N-1 is.
        end_rows: what each row at node N is.
        on_control: whether a row has a control in it, (rows,).
        stage_matrices: (t, parameters) -> A, B, Q, S, R, D_x, D_u.
        stage_vectors: (t, parameters) -> (c, q, r, constant, offset of the rows), one column.
        end_matrices: (t, parameters) -> P, D_f.
        end_vectors: (t, parameters) -> (p, constant, offset of the end rows), one column.
        row_box: bounds of the rows.
        end_box: bounds of the end rows.
    """

    ocp: OCP
    rows: tuple[ConstraintRow, ...]
    end_rows: tuple[ConstraintRow, ...]
    on_control: np.ndarray
    stage_matrices: ca.Function
    stage_vectors: ca.Function
    end_matrices: ca.Function
    end_vectors: ca.Function
    row_box: Box
    end_box: Box

    @cached_property
    def steps(self) -> int:
        """Number of steps N."""
        return self.ocp.steps or 0

    def on(self, data: RunData) -> LQData:
        """Return the numbers of a run.

        Raises:
            ProblemError: if parameters make a weight indefinite.
        """
        if self.fixed is not None:
            matrices = self.fixed
        else:
            matrices = self.sample_matrices(data)
            complaint = matrices.indefinite()
            if complaint:
                raise ProblemError(f"{self.ocp.name}: with these parameters {complaint}")
        return self._sample_vectors(data, matrices)

    # -- sampling ---------------------------------------------------------------------------

    @cached_property
    def fixed(self) -> Matrices | None:
        """The matrices, where they depend on neither time nor parameters."""
        varying = any(
            f.sparsity_jac(i, o).nnz()
            for f in (self.stage_matrices, self.end_matrices)
            for i in range(2)
            for o in range(f.n_out())
            if f.size1_in(i) and f.numel_out(o)
        )
        return None if varying else self.sample_matrices(self.declared)

    @property
    def declared(self) -> RunData:
        """The data of a run that leaves everything as declared."""
        return RunData.of(self.ocp)

    @cached_property
    def nodes(self) -> np.ndarray:
        """Instants of the nodes after t0 [s], (N + 1,)."""
        return np.linspace(0.0, self.ocp.duration, self.steps + 1)

    @cached_property
    def _vectors(self) -> tuple[NodeFunction, NodeFunction]:
        return NodeFunction(self.stage_vectors, self.steps), NodeFunction(self.end_vectors, 1)

    def _at(self, data: RunData) -> tuple[np.ndarray, np.ndarray]:
        """Return times (N + 1,) and parameters (N + 1, n_p) at the nodes."""
        return data.t0 + self.nodes, data.values.samples(self.steps + 1)

    def sample_matrices(self, data: RunData) -> Matrices:
        """Return the matrices of a run, whether convex or not."""
        t, p = self._at(data)
        blocks = [
            np.array(m).reshape(m.shape[0], self.steps, m.shape[1] // self.steps).transpose(1, 0, 2)
            for m in self.stage_matrices.map(self.steps)(t[None, :-1], p[:-1].T)
        ]
        end = [np.array(m) for m in self.end_matrices(t[-1], p[-1])]
        a, b, q, s, r, d_x, d_u = blocks
        return Matrices(a, b, q, s, r, end[0], d_x, d_u, end[1])

    def _sample_vectors(self, data: RunData, matrices: Matrices) -> LQData:
        t, p = self._at(data)
        _, n, m = matrices.B.shape
        stage, end = self._vectors[0](t[:-1], p[:-1]), self._vectors[1](t[-1:], p[-1:])[0]
        if not (np.isfinite(stage).all() and np.isfinite(end).all()):
            raise ProblemError(f"{self.ocp.name}: a linear term is not finite for these data")
        k = 2 * n + m
        lower = np.asarray(self.row_box.lower) - stage[:, k + 1 :]
        upper = np.asarray(self.row_box.upper) - stage[:, k + 1 :]
        lower[0, ~self.on_control], upper[0, ~self.on_control] = -np.inf, np.inf
        return LQData(
            matrices=matrices,
            c=stage[:, :n],
            qr=stage[:, n:k],
            constant=float(stage[:, k].sum() + end[n]),
            p=end[:n],
            lower=lower,
            upper=upper,
            lower_f=np.asarray(self.end_box.lower) - end[n + 1 :],
            upper_f=np.asarray(self.end_box.upper) - end[n + 1 :],
        )
