"""Refusal of plants that no pilot could hold: rank tests at every mode that is not stable."""

from __future__ import annotations

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.pilot.problem import MocmError
from rtsim.pilot.riccati import state_scale

_STABLE_MARGIN = 1e-7
_RANK_TOLERANCE = 1e-9


def unstable_modes(a: FloatArray) -> FloatArray:
    """Eigenvalues with real part >= 0, those on the axis included.

    Args:
        a: Dynamics (n, n).

    Returns:
        The eigenvalues, complex.
    """
    modes = np.linalg.eigvals(a)
    margin = _STABLE_MARGIN * max(1.0, float(np.max(np.abs(modes))))
    return np.asarray(modes[modes.real >= -margin])


def hidden_mode(a: FloatArray, c: FloatArray) -> complex | None:
    """The first mode, not stable, that the outputs do not show.

    The Popov-Belevitch-Hautus test in balanced states with rows of unit length, so that units do not matter.

    Args:
        a: Dynamics (n, n).
        c: Outputs (p, n).

    Returns:
        Its eigenvalue, or None where every such mode is seen.
    """
    n = a.shape[0]
    scale = state_scale(a, np.zeros((n, 0)), c)
    a_scaled, c_scaled = a * (scale / scale[:, None]), c * scale
    length = np.linalg.norm(c_scaled, axis=1)
    c_scaled = c_scaled[length > 0.0] / length[length > 0.0, None]
    for mode in unstable_modes(a_scaled):
        pencil = np.vstack([(a_scaled - mode * np.eye(n)) / max(1.0, abs(mode)), c_scaled])
        values = np.linalg.svd(pencil, compute_uv=False)
        if values[-1] < _RANK_TOLERANCE * max(1.0, float(values[0])):
            return complex(mode)
    return None


def check_modes(
    *, a: FloatArray, b: FloatArray, attended: FloatArray, regulator: FloatArray, weighted: FloatArray
) -> None:
    """Refuse a plant with a mode that is not stable and is out of the pilot's reach.

    Args:
        a: Plant dynamics (n, n).
        b: Plant controls (n, nu).
        attended: Rows of C that get attention (na, n).
        regulator: Dynamics with the controls as integrators (n0, n0).
        weighted: Weighted outputs of that system (nq, n0).

    Raises:
        MocmError: E_NOT_STABILISABLE, E_NOT_DETECTABLE or E_NOT_WEIGHTED.
    """
    mode = hidden_mode(a.T, b.T)
    if mode is not None:
        raise MocmError(
            "E_NOT_STABILISABLE", f"no control moves the mode at {mode:.4g} rad/s, which is not stable", key="B",
            mend="drop the state, give it a control, or put a filter's pole slightly left of the axis",
        )  # fmt: skip
    mode = hidden_mode(a, attended)
    if mode is not None:
        raise MocmError(
            "E_NOT_DETECTABLE", f"no attended display shows the mode at {mode:.4g} rad/s, which is not stable", key="C",
            mend="attend to a display that shows it, or drop the state",
        )  # fmt: skip
    mode = hidden_mode(regulator, weighted)
    if mode is not None:
        raise MocmError(
            "E_NOT_WEIGHTED", f"no weight sees the mode at {mode:.4g} rad/s, which is not stable", key="q_y",
            mend="weight a display (or control) that shows it, or drop the state",
        )  # fmt: skip
