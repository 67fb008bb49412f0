"""Algebraic Riccati and Lyapunov equations, solved in scaled states and polished by Newton's method.

Physical states mix radians with metres or feet; unscaled, the invariant-subspace method loses digits that the
noise fixed point then amplifies. Newton's method (Kleinman 1968) restores them and makes warm starts cheap: any
stabilizing gain starts it, whatever the weights.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, matrix_balance, solve_continuous_are, solve_continuous_lyapunov

from rtsim.arrays import FloatArray

_POLISH_STEPS = 30
_POLISH_TOLERANCE = 1e-11


class RiccatiFailure(Exception):
    """No stabilizing solution was found."""


def state_scale(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Typical magnitudes of the states, from balancing the whole system matrix.

    Args:
        a: Dynamics (n, n).
        b: Inputs (n, m).
        c: Outputs (p, n).

    Returns:
        Positive scales (n,), powers of two; ``x / scale`` is well conditioned.
    """
    n, m, p = a.shape[0], b.shape[1], c.shape[0]
    whole = np.zeros((n + m + p, n + m + p))
    whole[:n, :n], whole[:n, n : n + m], whole[n + m :, :n] = a, b, c
    _, (scale, _) = matrix_balance(whole, permute=False, separate=True)
    return np.asarray(scale[:n], dtype=np.float64)


def solve_lyapunov(a: FloatArray, q: FloatArray) -> FloatArray:
    """Solve ``a X + X a' + q = 0``, symmetric.

    Args:
        a: Stable dynamics (n, n).
        q: Symmetric intensity (n, n).

    Returns:
        The covariance X (n, n).
    """
    x = solve_continuous_lyapunov(a, -q)
    return np.asarray(0.5 * (x + x.T))


def _polish(a: FloatArray, b: FloatArray, q: FloatArray, gain: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Newton's method from a stabilizing gain, unit input weights; None where it does not settle."""
    previous = np.inf
    p = np.zeros_like(a)
    for _ in range(_POLISH_STEPS):
        p_next = solve_lyapunov((a - b @ gain).T, q + gain.T @ gain)
        if not np.all(np.isfinite(p_next)):
            return None
        gain = b.T @ p_next
        size = np.sqrt(np.abs(np.diag(p_next)))
        size = np.maximum(size, 1e-8 * float(np.max(size)) + 1e-150)
        change = float(np.max(np.abs(p_next - p) / np.outer(size, size)))
        p = p_next
        if change < _POLISH_TOLERANCE or (change < 1e-7 and change >= 0.5 * previous):
            return p, gain
        previous = change
    return None


def solve_riccati(
    a: FloatArray, b: FloatArray, q: FloatArray, r: FloatArray, *, gain: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Solve ``a'P + P a + q - P b diag(r)^-1 b'P = 0`` for its stabilizing solution.

    Args:
        a: Dynamics (n, n).
        b: Inputs (n, m).
        q: Symmetric state weight (n, n).
        r: Positive input weights (m,).
        gain: A stabilizing gain (m, n) to start from, for example that of a neighbouring problem.

    Returns:
        P (n, n) and the gain ``diag(r)^-1 b' P`` (m, n).

    Raises:
        RiccatiFailure: There is no stabilizing solution, or it cannot be told from none.
    """
    root = np.sqrt(r)
    scale = state_scale(a, b / root, np.sqrt(np.abs(np.diag(q)))[None, :])
    a_scaled, b_scaled = a * (scale / scale[:, None]), (b / root) / scale[:, None]
    q_scaled = q * np.outer(scale, scale)
    q_scaled = 0.5 * (q_scaled + q_scaled.T)
    solution = None
    try:
        if gain is not None:
            solution = _polish(a_scaled, b_scaled, q_scaled, gain * root[:, None] * scale)
        if solution is None:
            p = solve_continuous_are(a_scaled, b_scaled, q_scaled, np.eye(b.shape[1]))
            start = b_scaled.T @ p
            if float(np.max(np.linalg.eigvals(a_scaled - b_scaled @ start).real)) >= 0.0:
                raise RiccatiFailure("the solution does not stabilize")
            solution = _polish(a_scaled, b_scaled, q_scaled, start) or (p, start)
    except (LinAlgError, ValueError) as error:
        raise RiccatiFailure(str(error)) from error
    return solution[0] / np.outer(scale, scale), solution[1] / (root[:, None] * scale)
