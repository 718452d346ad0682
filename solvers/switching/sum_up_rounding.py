r"""Sum-up rounding: of shares that vary, one choice an interval, whose sums stay near.

With shares :math:`\alpha_{ik} \ge 0`, :math:`\sum_i \alpha_{ik} = 1` of M modes on intervals of
width :math:`h_k`, the mode of an interval is the one that has been short most:

.. math::
    i(k) = \arg\max_i \; \sum_{j \le k} \alpha_{ij} h_j - \sum_{j < k} \omega_{ij} h_j ,
    \qquad
    \max_t \Big| \int_0^t (\alpha - \omega) \, ds \Big|_\infty \le (M - 1) \max_k h_k

Source: [Sager, Bock & Diehl 2012].
"""

import numpy as np


def sum_up_rounding(shares: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Return which mode acts on each interval, int (N,).

    Args:
        shares: of every mode on every interval, 0 to 1, adding up to 1, (N, M).
        widths: of the intervals, in one unit, (N,).
    """
    short, chosen = np.zeros(shares.shape[1]), np.zeros(len(shares), dtype=int)
    for k, width in enumerate(widths):
        short += shares[k] * width
        chosen[k] = int(short.argmax())
        short[chosen[k]] -= width
    return chosen


def deviation(shares: np.ndarray, chosen: np.ndarray, widths: np.ndarray) -> float:
    """Return the largest difference of the integrals of shares (N, M) and choices (N,)."""
    choices = np.eye(shares.shape[1])[chosen]
    return float(np.abs(np.cumsum((shares - choices) * widths[:, None], axis=0)).max())
