"""What a designed pilot does: transfer matrix, return ratios and margins, closed loop and remnant (M11-M13)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from rtsim.arrays import ComplexArray, FloatArray
from rtsim.pilot.estimator import Estimator, InternalModel
from rtsim.pilot.problem import MocmProblem
from rtsim.pilot.regulator import DelayedPlant, Regulator
from rtsim.pilot.riccati import solve_lyapunov

LOWEST_FREQUENCY = 0.01
"""Lower end of the search for crossovers [rad/s]."""
HIGHEST_FREQUENCY = 60.0
"""Upper end of the search for crossovers [rad/s]."""
_GRID = 1500


@dataclass(frozen=True, slots=True)
class PilotSystem:
    """The pilot as a linear system from displays to controls, states [xhat; u_p; xd] (M11)."""

    A: FloatArray
    """Dynamics (np, np)."""
    B: FloatArray
    """Displays (np, ny)."""
    C: FloatArray
    """Controls after the delay (nu, np)."""


@dataclass(frozen=True, slots=True)
class Margins:
    """Stability margins of each control, opened with the others closed (M12)."""

    w_c: FloatArray
    """Last downward crossing of unit gain within 0.01 to 60 rad/s [rad/s] (nu,); NaN where there is none."""
    phase_margin: FloatArray
    """180 deg plus the phase there [deg] (nu,); NaN where there is none."""
    gain_margin: FloatArray
    """Smallest increase of gain that reaches -1 above the crossover [dB] (nu,); infinite where none does."""


def pilot_system(model: InternalModel, plant: DelayedPlant, regulator: Regulator, estimator: Estimator) -> PilotSystem:
    """Assemble filter, gains, neuromotor lag and delay.

    Args:
        model: The internal model.
        plant: Plant with delay, for its filter.
        regulator: Gains.
        estimator: Filter gain.

    Returns:
        The pilot from displays to delayed controls.
    """
    n1, nu = model.B.shape
    delay, g2 = plant.delay, regulator.G2
    nd = delay.A.shape[0]
    a = np.block(
        [
            [model.A - model.B @ model.l - estimator.F @ model.C, np.zeros((n1, nu + nd))],
            [-g2 @ model.l, -g2, np.zeros((nu, nd))],
            [np.zeros((nd, n1)), delay.B, delay.A],
        ]
    )
    b = np.vstack([estimator.F, np.zeros((nu + nd, estimator.F.shape[1]))])
    return PilotSystem(A=a, B=b, C=np.hstack([np.zeros((nu, n1)), delay.D, delay.C]))


def frequency_response(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray | None, frequencies: FloatArray
) -> ComplexArray:
    """Evaluate ``c (j w I - a)^-1 b + d``.

    Args:
        a: Dynamics (n, n).
        b: Inputs (n, m).
        c: Outputs (p, n).
        d: Feed-through (p, m), or None.
        frequencies: w [rad/s] (k,).

    Returns:
        The response (k, p, m).
    """
    pencil = 1j * np.asarray(frequencies)[:, None, None] * np.eye(a.shape[0]) - a
    response = c @ np.linalg.solve(pencil, np.broadcast_to(b.astype(np.complex128), (len(pencil), *b.shape)))
    return np.asarray(response if d is None else response + d)


def return_ratio(problem: MocmProblem, pilot: PilotSystem, frequencies: FloatArray) -> ComplexArray:
    """Return ratio at each control with the other controls closed (M12).

    Args:
        problem: The design problem, for its plant.
        pilot: The pilot.
        frequencies: w [rad/s] (k,).

    Returns:
        L_j(jw), positive for negative feedback, shape (k, nu).
    """
    y_p = frequency_response(pilot.A, pilot.B, pilot.C, None, frequencies)
    plant = frequency_response(problem.A, problem.B, problem.C, problem.D, frequencies)
    return one_at_a_time(-y_p @ plant)


def one_at_a_time(loop: ComplexArray) -> ComplexArray:
    """Open each channel of a return-ratio matrix with all others closed.

    Args:
        loop: Return-ratio matrices (k, m, m).

    Returns:
        ``L_jj - L_jo (I + L_oo)^-1 L_oj`` (k, m).
    """
    channels = loop.shape[1]
    if channels == 1:
        return loop[:, :, 0]
    result = np.empty(loop.shape[:2], dtype=np.complex128)
    for j in range(channels):
        others = [i for i in range(channels) if i != j]
        closed = np.eye(len(others)) + loop[:, others][:, :, others]
        others_response = np.linalg.solve(closed, loop[:, others, j][:, :, None])
        result[:, j] = loop[:, j, j] - (loop[:, j, others][:, None, :] @ others_response)[:, 0, 0]
    return result


def margins(ratio: Callable[[FloatArray], ComplexArray], extra_frequencies: FloatArray | None = None) -> Margins:
    """Crossover, phase margin and gain margin of each channel of a return ratio.

    Args:
        ratio: Function of frequencies (k,) giving the return ratios (k, nu).
        extra_frequencies: Further grid points, for instance at lightly damped modes [rad/s].

    Returns:
        The margins.
    """
    grid = np.geomspace(LOWEST_FREQUENCY, HIGHEST_FREQUENCY, _GRID)
    if extra_frequencies is not None:
        inside = (extra_frequencies > LOWEST_FREQUENCY) & (extra_frequencies < HIGHEST_FREQUENCY)
        grid = np.unique(np.concatenate([grid, extra_frequencies[inside]]))
    response = ratio(grid)
    count = response.shape[1]
    w_c, phase, gain = np.full(count, np.nan), np.full(count, np.nan), np.full(count, np.inf)
    for j in range(count):

        def at(frequency: float, channel: int = j) -> complex:
            return complex(ratio(np.array([frequency]))[0, channel])

        w_c[j], phase[j] = _crossover(at, grid, response[:, j])
        gain[j] = _gain_margin(at, grid, response[:, j], above=float(w_c[j]))
    return Margins(w_c=w_c, phase_margin=phase, gain_margin=gain)


def _crossover(at: Callable[[float], complex], grid: FloatArray, response: ComplexArray) -> tuple[float, float]:
    """Last downward crossing of unit gain and the phase margin there; NaN where there is none."""
    size = np.log(np.abs(response))
    down = np.flatnonzero((size[:-1] > 0.0) & (size[1:] <= 0.0))
    if not down.size:
        return np.nan, np.nan
    k = down[-1]
    frequency = float(brentq(lambda w: np.log(abs(at(w))), grid[k], grid[k + 1], xtol=1e-10))
    return frequency, 180.0 + float(np.degrees(np.angle(at(frequency))))


def _gain_margin(at: Callable[[float], complex], grid: FloatArray, response: ComplexArray, *, above: float) -> float:
    """Smallest increase of gain [dB] that reaches -1 beyond the crossover."""
    imaginary, real = response.imag, response.real
    crossings = np.flatnonzero((imaginary[:-1] * imaginary[1:] <= 0.0) & (real[:-1] < 0.0) & (real[1:] < 0.0))
    smallest = np.inf
    for k in crossings:
        frequency = float(brentq(lambda w: at(w).imag, grid[k], grid[k + 1], xtol=1e-10))
        reserve = -20.0 * float(np.log10(abs(at(frequency))))
        if 0.0 < reserve < smallest and not frequency <= above:
            smallest = reserve
    return smallest


def pilot_margins(problem: MocmProblem, pilot: PilotSystem) -> Margins:
    """Margins of the designed loop.

    Args:
        problem: The design problem, for its plant.
        pilot: The pilot.

    Returns:
        The margins at each control.
    """
    modes = np.abs(np.concatenate([np.linalg.eigvals(problem.A), np.linalg.eigvals(pilot.A)]).imag)
    nearby = (modes[:, None] * np.array([0.97, 0.99, 1.0, 1.01, 1.03])).ravel()
    return margins(lambda w: return_ratio(problem, pilot, w), nearby)


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Plant and pilot together, states [x; xhat; u_p; xd], inputs [w; v_y of attended displays; v_u] (M13)."""

    A: FloatArray
    """Dynamics (nc, nc)."""
    B: FloatArray
    """Noises (nc, nw + na + nu)."""
    intensity: FloatArray
    """Intensity of the noises (nw + na + nu, nw + na + nu)."""
    C: FloatArray
    """Displays, then controls after the delay (ny + nu, nc)."""
    disturbances: int
    """nw, the number of leading noise inputs that are not the pilot's."""

    def variances(self, *, remnant_only: bool = False) -> FloatArray:
        """Variances of displays and delayed controls.

        Args:
            remnant_only: Leave the disturbances out.

        Returns:
            Variances (ny + nu,).
        """
        intensity = self.intensity.copy()
        if remnant_only:
            intensity[: self.disturbances] = 0.0
            intensity[:, : self.disturbances] = 0.0
        covariance = solve_lyapunov(self.A, self.B @ intensity @ self.B.T)
        return np.asarray(np.einsum("ij,jk,ik->i", self.C, covariance, self.C))


def closed_loop(
    problem: MocmProblem, model: InternalModel, plant: DelayedPlant, regulator: Regulator, estimator: Estimator
) -> ClosedLoop:
    """Join the true plant and the pilot.

    Args:
        problem: The design problem.
        model: The internal model.
        plant: Plant with delay.
        regulator: Gains.
        estimator: Filter and noises.

    Returns:
        The joint system.
    """
    n, nu = problem.B.shape
    pilot = pilot_system(model, plant, regulator, estimator)
    n1, size = model.A.shape[0], pilot.A.shape[0]
    rows = problem.attended
    controls = np.hstack([np.zeros((nu, n)), pilot.C])
    displays = np.hstack([problem.C, np.zeros((problem.C.shape[0], size))]) + problem.D @ controls
    a = np.vstack(
        [np.hstack([problem.A, np.zeros((n, size))]) + problem.B @ controls, pilot.B @ displays],
    )
    a[n:, n:] += pilot.A
    noise_in_pilot = np.zeros((size, rows.size + nu))
    noise_in_pilot[:n1, : rows.size] = estimator.F[:, rows]
    noise_in_pilot[n1 : n1 + nu, rows.size :] = regulator.G2
    return ClosedLoop(
        A=a,
        B=block_diag(problem.E, noise_in_pilot),
        intensity=block_diag(problem.W, np.diag(estimator.V_y), np.diag(estimator.V_u)),
        C=np.vstack([displays, controls]),
        disturbances=problem.W.shape[0],
    )
