"""All states and controls as linear functions of the inputs: the stacked form (2.4)."""

from dataclasses import dataclass

import numpy as np

from ocp.internal import LQData, Matrices


@dataclass(frozen=True, eq=False)
class StackedPrediction:
    r"""States and controls under u = -Kx + v, stacked.

    .. math:: \begin{pmatrix} x_k \\ u_k \end{pmatrix} = Z_k V + \text{nominal}, \qquad
              x_N = Z_N V + \text{nominal}

    With K = 0 this is (2.4); with a stabilising K no power of an unstable A appears, and the
    Hessian stays well conditioned whatever plant and horizon [Rossiter et al. 1998].

    The nominal trajectory is linear in x_0 and the drifts c_k, by a matrix whose transpose
    leads slopes back to costates.

    Attributes:
        feedback: K (N, m, n).
        response: of x_0..x_N to (x_0, c_0, ..., c_{N-1}), both ((N + 1) n,).
        stages: Z_k (N, n + m, N m).
        end: Z_N (n, N m).
        hessian: of the cost in V, (N m, N m): 2 H of (2.8).
        condition: condition number of the Hessian.
    """

    feedback: np.ndarray
    response: np.ndarray
    stages: np.ndarray
    end: np.ndarray
    hessian: np.ndarray
    condition: float

    @classmethod
    def of(cls, matrices: Matrices, feedback: np.ndarray) -> "StackedPrediction":
        """Stack the matrices."""
        steps, n, m = matrices.B.shape
        closed = matrices.A - matrices.B @ feedback
        z, x = np.zeros((steps, n + m, steps * m)), np.zeros((n, steps * m))
        response = np.eye((steps + 1) * n).reshape(steps + 1, n, -1)
        for k in range(steps):
            own = slice(k * m, (k + 1) * m)
            z[k, :n] = x
            z[k, n:] = -feedback[k] @ x
            z[k, n:, own] = np.eye(m)
            x = closed[k] @ x
            x[:, own] = matrices.B[k]
            response[k + 1] += closed[k] @ response[k]
        flat = z.reshape(-1, steps * m)
        weighted = (matrices.weights @ z).reshape(-1, steps * m)
        hessian = 2.0 * (flat.T @ weighted + x.T @ matrices.P @ x)
        hessian = (hessian + hessian.T) / 2
        square = response.reshape((steps + 1) * n, -1)
        return cls(feedback, square, z, x, hessian, _condition(hessian))

    def nominal(self, data: LQData, x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (x, u) at nodes 0..N-1 with V = 0, (N, n + m), and x_N."""
        x = (self.response @ np.append(x0, data.c)).reshape(-1, len(x0))
        u = -(self.feedback @ x[:-1, :, None])[:, :, 0]
        return np.hstack([x[:-1], u]), x[-1]

    def gradient(self, data: LQData, z: np.ndarray, x_end: np.ndarray) -> np.ndarray:
        """Return the gradient of the cost in V at V = 0, from the nominal trajectory."""
        slope = (data.matrices.weights @ z[:, :, None])[:, :, 0] + data.qr
        final = data.matrices.P @ x_end + data.p
        return 2.0 * (slope.ravel() @ self._flat + final @ self.end)

    def trajectory(
        self, data: LQData, x0: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states (N + 1, n) and controls (N, m) of inputs V (N m,)."""
        z, x_end = self.nominal(data, x0)
        z += (self._flat @ v).reshape(z.shape)
        n = len(x0)
        return np.vstack([z[:, :n], x_end + self.end @ v]), z[:, n:]

    def costates(self, by_x: np.ndarray, by_u: np.ndarray, final: np.ndarray) -> np.ndarray:
        """Return the costates (N + 1, n): for any feedback the same, where H_u = 0.

        Args:
            by_x: derivatives of the running cost and of the constraints' terms, (N, n).
            by_u: the same by the control (N, m).
            final: costate at the end (n,).
        """
        slope = by_x - (by_u[:, None] @ self.feedback)[:, 0]
        return (np.append(slope, final) @ self.response).reshape(-1, len(final))

    @property
    def _flat(self) -> np.ndarray:
        """All Z_k above each other, (N (n + m), N m)."""
        return self.stages.reshape(-1, self.stages.shape[2])


def _condition(hessian: np.ndarray) -> float:
    """Ratio of the extreme eigenvalues; infinite where one is not positive."""
    if not np.isfinite(hessian).all():
        return np.inf
    values = np.linalg.eigvalsh(hessian)
    return float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
