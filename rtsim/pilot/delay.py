"""The pilot's effective delay as a filter on the plant's input (formula M1 of docs/pilot.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.pilot.problem import PadeKind

SECOND_ORDER_CONSTANT: dict[str, float] = {"pade": 12.0, "taylor": 8.0}
"""k in (s^2 - k s/(2 tau) + k/tau^2) / (s^2 + ...): 12 is the true Pade (2, 2), 8 the truncated series."""


@dataclass(frozen=True, slots=True)
class DelayFilter:
    """xd' = A xd + B u_p, delta = C xd + D u_p; one filter per control, side by side."""

    A: FloatArray
    """Dynamics (nd, nd)."""
    B: FloatArray
    """Input (nd, nu)."""
    C: FloatArray
    """Output (nu, nd)."""
    D: FloatArray
    """Feed-through (nu, nu)."""


def _one_filter(tau: float, order: int, kind: PadeKind) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    if tau == 0.0 or order == 0:
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0
    if order == 1:
        return np.array([[-2.0 / tau]]), np.array([[1.0]]), np.array([[4.0 / tau]]), -1.0
    constant = SECOND_ORDER_CONSTANT[kind]
    a, b = constant / (2.0 * tau), constant / tau**2
    return np.array([[0.0, 1.0], [-b, -a]]), np.array([[0.0], [1.0]]), np.array([[0.0, -2.0 * a]]), 1.0


def delay_filter(tau: FloatArray, *, order: int = 2, kind: PadeKind = "pade") -> DelayFilter:
    """All-pass filters that stand for pure delays.

    Args:
        tau: Delay of each control [s], shape (nu,); a zero gives no states.
        order: 0 (no delay at all), 1 or 2.
        kind: For order 2: "pade" or "taylor" (see ``SECOND_ORDER_CONSTANT``).

    Returns:
        The filters of all controls in one realization.
    """
    from scipy.linalg import block_diag

    parts = [_one_filter(float(value), order, kind) for value in tau]
    rows = sum(part[0].shape[0] for part in parts)
    controls = len(parts)
    # block_diag keeps the rows and columns of empty blocks, so mixed delays stay aligned
    return DelayFilter(
        A=block_diag(*[part[0] for part in parts]).reshape(rows, rows),
        B=block_diag(*[part[1] for part in parts]).reshape(rows, controls),
        C=block_diag(*[part[2] for part in parts]).reshape(controls, rows),
        D=np.diag([part[3] for part in parts]),
    )
