"""Handling numbers of the aircraft in the pilot's hands: roots, damping and attitude bandwidth, with any set of aids.

The loop is the one that flies: the LPV aircraft's Runge-Kutta step and the aids' kernel, frame by frame, linearized
numerically about a trim. Attitude bandwidth follows ADS-33E-PRF 3.4.1: the lower of the frequency at which pitch lags
the stick by 135 deg and the frequency at which 6 dB are left to the gain at 180 deg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtsim.aids.aids_kernels import AID_COUNT, MEMORY, aids_engage, aids_step
from rtsim.aids.design import design_aids, switches_of
from rtsim.arrays import FloatArray
from rtsim.choices import AidName
from rtsim.lpv.aircraft import LpvAircraft
from rtsim.lpv.lpv_kernels import lpv_step, work_size
from rtsim.lpv.tables import prepare_tables

DT = 0.004
"""Frame of the linearized loop [s]."""
_STEP = 1e-5


@dataclass(frozen=True, slots=True)
class Handling:
    """Handling numbers at one condition."""

    roots: npt.NDArray[np.complex128]
    """Roots of the sampled loop as log(z)/dt [rad/s], slow aids' memories left out, rightmost first."""
    bandwidth: float
    """Attitude bandwidth, stick to pitch [rad/s]; 0 where even slow stick motion lags by more than 135 deg."""

    @property
    def rightmost(self) -> float:
        """Real part of the rightmost root [rad/s]."""
        return float(self.roots[0].real)

    @property
    def oscillation(self) -> complex:
        """The least damped oscillation between 0.1 and 4 rad/s; 0 where there is none."""
        mid = self.roots[(self.roots.imag > 0.05) & (np.abs(self.roots) < 4.0)]
        return complex(mid[np.argmin(-mid.real / np.abs(mid))]) if mid.size else 0j


def handling(aircraft: LpvAircraft, *, airspeed: float, nacelle: float, aids: tuple[AidName, ...]) -> Handling:
    """Linearize the aircraft with aids about its level trim.

    Args:
        aircraft: The LPV aircraft.
        aids: The aids that are on.
    """
    trim = aircraft.trim(airspeed=airspeed, nacelle=nacelle)
    lpv, tables, switches = prepare_tables(aircraft.database), design_aids(aircraft.database), switches_of(aids)
    work = np.zeros(work_size(lpv))
    x0, acting0 = trim.x.copy(), trim.u[:2].copy()
    hands0 = np.array([0.0 if "attitude_retention" in aids else acting0[0], acting0[1]])
    state0 = np.zeros(MEMORY.size)
    aids_engage(tables, state0, switches, x0, nacelle, hands0, np.zeros(3), acting0)
    path = np.tile([nacelle, 0.0, 0.0], (3, 1))

    def frame(z: FloatArray, stick: float) -> FloatArray:
        x, state = z[: x0.size].copy(), np.concatenate([z[x0.size :], switches[:AID_COUNT]])
        acting, u = acting0.copy(), trim.u.copy()
        aids_step(tables, state, switches, x, nacelle, hands0 + np.array([stick, 0.0]), np.zeros(3), acting, DT)
        u[:2] = acting
        lpv_step(lpv, x, u, path, DT, work)
        return np.concatenate([x, state[: MEMORY.last_switches]])

    z0 = np.concatenate([x0, state0[: MEMORY.last_switches]])
    a = np.array([(frame(z0 + _STEP * e, 0.0) - frame(z0 - _STEP * e, 0.0)) / (2.0 * _STEP) for e in np.eye(z0.size)]).T
    # A pulse beyond the dead zone, so that the commanded rate is seen too.
    size = 0.2
    b = (frame(z0, size) - frame(z0, -size)) / (2.0 * size)
    z = np.linalg.eigvals(a)
    roots = np.log(z[np.abs(z) > 1e-6].astype(complex)) / DT
    # Integrators of height and of references that nothing feeds stand at the origin.
    roots = roots[np.abs(roots) > 2e-3]
    return Handling(roots[np.argsort(-roots.real)], _bandwidth(a, b, "attitude_retention" in aids))


def _bandwidth(a: FloatArray, b: FloatArray, attitude: bool) -> float:
    """ADS-33 attitude bandwidth of the response from stick (aft positive) to pitch."""
    frequencies = np.geomspace(0.05, 20.0, 600)
    eye = np.eye(a.shape[0])
    response = np.array([-np.linalg.solve(np.exp(1j * w * DT) * eye - a, b)[3] for w in frequencies])
    phase = np.unwrap(np.angle(response))
    # Above the slow speed modes the phase comes down from -90 (rate) or 0 (attitude): count turns from there.
    start = int(np.searchsorted(frequencies, 0.5))
    phase -= 2.0 * math.pi * round((phase[start] + 0.5 * math.pi) / (2.0 * math.pi))
    below = np.flatnonzero(phase[start:] < -0.75 * math.pi)
    if not below.size or below[0] == 0:
        return 0.0
    by_phase = float(frequencies[start + below[0]])
    half = np.flatnonzero(phase[start:] < -math.pi)
    if attitude or not half.size:
        return by_phase
    limit = 2.0 * abs(response[start + half[0]])
    gained = np.flatnonzero(np.abs(response[start:]) < limit)
    by_gain = float(frequencies[start + gained[0]]) if gained.size and gained[0] > 0 else by_phase
    return min(by_phase, by_gain)
