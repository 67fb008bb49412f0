"""The pilot's internal model and Kalman filter, with noises that scale with what they disturb (M6-M10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, block_diag
from scipy.special import erfc

from rtsim.arrays import FloatArray
from rtsim.pilot.problem import MocmError, MocmProblem
from rtsim.pilot.regulator import DelayedPlant, Regulator
from rtsim.pilot.riccati import RiccatiFailure, solve_lyapunov, solve_riccati

_TOLERANCE = 1e-9
_MOST_STEPS = 400
_MEMORY = 5
_PLAIN_STEPS = 3
_LARGEST_STEP = 4.0
_DIVERGED = 1e9
_LEAST_VISIBILITY = 1e-6
"""Floor of the threshold's describing function: a display that never leaves its dead zone is practically unseen."""


@dataclass(frozen=True, slots=True)
class InternalModel:
    """What the pilot believes: plant, delay and neuromotor lag, states [x; xd; u_p] (M6)."""

    A: FloatArray
    """Dynamics (n1, n1)."""
    B: FloatArray
    """Commanded controls (n1, nu)."""
    C: FloatArray
    """Displays (ny, n1)."""
    E: FloatArray
    """Disturbances and motor noises (n1, nw + nu)."""
    l: FloatArray  # noqa: E741  # the literature's symbol
    """Commanded-control gain (nu, n1), zero on u_p."""


@dataclass(frozen=True, slots=True)
class Estimator:
    """Kalman filter and noises of a self-consistent pilot."""

    F: FloatArray
    """Filter gain (n1, ny); columns of unattended displays are zero."""
    S: FloatArray
    """Covariance of the estimation error (n1, n1)."""
    Xh: FloatArray
    """Covariance of the estimate (n1, n1)."""
    V_y: FloatArray
    """Intensity of the observation noise of each attended display (na,)."""
    V_u: FloatArray
    """Intensity of the motor noise of each control (nu,)."""
    iterations: int
    """Evaluations of the noise map."""


def internal_model(plant: DelayedPlant, regulator: Regulator) -> InternalModel:
    """Put the neuromotor lag in front of the delayed plant.

    Args:
        plant: Plant with delay.
        regulator: Its gains.

    Returns:
        The internal model.
    """
    ns, nu = plant.B.shape
    return InternalModel(
        A=np.block([[plant.A, plant.B], [np.zeros((nu, ns)), -regulator.G2]]),
        B=np.vstack([np.zeros((ns, nu)), regulator.G2]),
        C=np.hstack([plant.C, plant.D]),
        E=block_diag(plant.E, regulator.G2),
        l=np.hstack([regulator.l, np.zeros((nu, nu))]),
    )


class _NoiseMap:
    """Noise intensities -> filter -> variances -> noise intensities that those variances imply."""

    def __init__(self, problem: MocmProblem, model: InternalModel, gain: FloatArray | None) -> None:
        self.problem, self.model = problem, model
        self.rows = problem.attended
        self.noisy = np.flatnonzero(problem.rho_u > 0.0)
        self.C = model.C[self.rows]
        self.closed = model.A - model.B @ model.l
        self.gain = gain
        self.evaluations = 0

    def implied(self, covariance: FloatArray, estimate: FloatArray) -> FloatArray:
        """Log intensities that follow from the covariances of the state and of the estimate (M8, M9)."""
        p, rows = self.problem, self.rows
        variance_y = np.einsum("ij,jk,ik->i", self.C, covariance, self.C)
        variance_u = np.einsum("ij,jk,ik->i", self.model.l, estimate, self.model.l)[self.noisy]
        still = np.flatnonzero(~(variance_y > 0.0))
        if still.size:
            raise MocmError(
                "E_NO_EXCITATION",
                f"nothing moves display {int(rows[still[0]]) + 1}, so its noise has no scale",
                key="E",
                mend="set its attention f to 0, or let a disturbance move it",
            )  # fmt: skip
        if not np.all(variance_u > 0.0):
            raise MocmError("E_NO_EXCITATION", "nothing moves a control, so its motor noise has no scale", key="E")
        seen = np.maximum(erfc(p.threshold[rows] / np.sqrt(2.0 * variance_y)), _LEAST_VISIBILITY)
        v_y = np.pi * p.rho_y[rows] * variance_y / (p.f[rows] * seen**2)
        v_u = np.pi * p.rho_u[self.noisy] * variance_u
        return np.asarray(np.log(np.concatenate([v_y, v_u])))

    def split(self, log_v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Observation noises (na,) and motor noises (nu,) of a vector of log intensities."""
        v_u = np.zeros(self.problem.rho_u.size)
        v_u[self.noisy] = np.exp(log_v[self.rows.size :])
        return np.exp(log_v[: self.rows.size]), v_u

    def start(self) -> FloatArray:
        """Intensities if the pilot knew the state exactly: below any solution."""
        source = self.model.E @ block_diag(self.problem.W, np.zeros((self.problem.rho_u.size,) * 2)) @ self.model.E.T
        covariance = solve_lyapunov(self.closed, source)
        return self.implied(covariance, covariance)

    def filter(self, log_v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Filter gain of the attended displays (n1, na), error covariance, covariance of the estimate."""
        v_y, v_u = self.split(log_v)
        source = self.model.E @ block_diag(self.problem.W, np.diag(v_u)) @ self.model.E.T
        error, gain = solve_riccati(self.model.A.T, self.C.T, source, v_y, gain=self.gain)
        self.gain = gain
        self.evaluations += 1
        return gain.T, error, solve_lyapunov(self.closed, gain.T @ (v_y[:, None] * gain))

    def __call__(self, log_v: FloatArray) -> FloatArray:
        """One plain step of the fixed-point iteration."""
        _, error, estimate = self.filter(log_v)
        return self.implied(error + estimate, estimate)


def _mixed_step(points: list[FloatArray], residuals: list[FloatArray]) -> FloatArray:
    """Anderson mixing of the last points, limited in length."""
    steps = np.array([residuals[-1] - r for r in residuals[:-1]]).T
    moves = np.array([points[-1] - x for x in points[:-1]]).T
    weights, *_ = np.linalg.lstsq(steps, residuals[-1], rcond=1e-8)
    step = np.asarray(residuals[-1] - (moves + steps) @ weights)
    return step * min(1.0, _LARGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))


def _fixed_point(noise_map: _NoiseMap, log_v: FloatArray) -> FloatArray:
    """Solve log V = map(log V); refuse where the noise grows without bound (M10)."""
    first = log_v.copy()
    points: list[FloatArray] = []
    residuals: list[FloatArray] = []
    best = np.inf
    for count in range(_MOST_STEPS):
        residual = noise_map(log_v) - log_v
        size = float(np.max(np.abs(residual)))
        if size < _TOLERANCE:
            return log_v
        grown = float(np.max(log_v - first))
        if grown > np.log(_DIVERGED) and float(np.max(residual)) > 0.0:
            raise _diverges()
        if size > 3.0 * best:  # the mixing went astray: plain steps from here
            points, residuals = [], []
        best = min(best, size)
        points, residuals = [*points[-_MEMORY:], log_v], [*residuals[-_MEMORY:], residual]
        step = _mixed_step(points, residuals) if count >= _PLAIN_STEPS and len(points) > 2 else residual
        log_v = log_v + step
    raise MocmError(
        "E_NO_CONVERGENCE", f"the noises did not settle in {_MOST_STEPS} steps (residual {size:.1e})", key="rho_y"
    )


def _diverges() -> MocmError:
    return MocmError(
        "E_REMNANT_DIVERGES", "the pilot's own noise grows without bound: this plant cannot be held", key="rho_y",
        mend="raise attention f, shorten tau or tau_n, or lower the noise ratios",
    )  # fmt: skip


def design_estimator(problem: MocmProblem, model: InternalModel, *, start: Estimator | None = None) -> Estimator:
    """Find the filter whose noises agree with the variances it produces.

    Args:
        problem: The design problem.
        model: The internal model.
        start: Estimator of a neighbouring problem of the same sizes, to save time.

    Returns:
        Filter, noises and covariances.

    Raises:
        MocmError: E_REMNANT_DIVERGES, E_NO_EXCITATION or E_NO_CONVERGENCE.
    """
    attended = problem.attended
    gain = None
    if start is not None:
        gain = start.F[:, attended].T
        if np.max(np.linalg.eigvals(model.A - gain.T @ model.C[attended]).real) >= 0.0:
            gain = None
    noise_map = _NoiseMap(problem, model, gain)
    try:
        log_v = noise_map.start()
        if start is not None and start.V_y.size == attended.size and np.all(start.V_u[noise_map.noisy] > 0.0):
            log_v = np.log(np.concatenate([start.V_y, start.V_u[noise_map.noisy]]))
        log_v = _fixed_point(noise_map, log_v)
        f_attended, error, estimate = noise_map.filter(log_v)
    except (RiccatiFailure, LinAlgError) as failure:
        raise MocmError(
            "E_NO_EXCITATION", f"the filter has no solution: a mode on the axis is not disturbed ({failure})", key="E",
            mend="let a disturbance reach every integrator, or give rho_u > 0",
        ) from failure  # fmt: skip
    f_all = np.zeros((model.A.shape[0], problem.C.shape[0]))
    f_all[:, attended] = f_attended
    v_y, v_u = noise_map.split(log_v)
    return Estimator(F=f_all, S=error, Xh=estimate, V_y=v_y, V_u=v_u, iterations=noise_map.evaluations)
