"""Handling numbers of the aircraft in the pilot's hands: roots, bandwidth and phase delay, with any set of aids.

The loop is the one that flies, linearized (``handling_loop``). Bandwidth and phase delay follow ADS-33E-PRF 3.3.2.1:
the bandwidth is the lower of the frequency at which the attitude lags the control by 135 deg and the frequency at which
6 dB are left to the gain at 180 deg; the phase delay is how fast the phase falls beyond.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rtsim.analysis.handling_loop import LinearLoop, lateral_loop, symmetric_loop
from rtsim.choices import AidName
from rtsim.lpv.aircraft import LpvAircraft

_LOWEST, _HIGHEST, _CHECKED_FROM = 0.05, 40.0, 0.5
_RIGID_ROOTS = 8.0
"""Roots beyond are those of rotors and actuators [rad/s]."""
_SLOW_ROOT = 0.5
"""A real root that is slower may be the spiral [rad/s]."""


@dataclass(frozen=True, slots=True)
class Response:
    """How an attitude follows its control."""

    bandwidth: float
    """Attitude bandwidth [rad/s]; 0 where even slow motion lags by more than 135 deg."""
    phase_delay: float
    """Phase delay [s]; 0 where the phase never comes to 180 deg."""


@dataclass(frozen=True, slots=True)
class Handling:
    """Handling numbers at one condition, in the plane of symmetry."""

    roots: npt.NDArray[np.complex128]
    """Roots of the sampled loop as log(z)/dt [rad/s], slow aids' memories left out, rightmost first."""
    pitch: Response
    """Stick to pitch."""

    @property
    def rightmost(self) -> float:
        """Real part of the rightmost root [rad/s]."""
        return float(self.roots[0].real)

    @property
    def oscillation(self) -> complex:
        """The least damped oscillation between 0.1 and 4 rad/s; 0 where there is none."""
        return _oscillation(self.roots)


@dataclass(frozen=True, slots=True)
class LateralHandling:
    """Handling numbers at one condition, out of the plane of symmetry."""

    roots: npt.NDArray[np.complex128]
    """As in ``Handling``."""
    roll: Response
    """Lateral stick to bank."""
    yaw: Response
    """Pedal to heading."""

    @property
    def rightmost(self) -> float:
        """Real part of the rightmost root [rad/s]."""
        return float(self.roots[0].real)

    @property
    def dutch_roll(self) -> complex:
        """The least damped oscillation between 0.1 and 4 rad/s; 0 where there is none."""
        return _oscillation(self.roots)

    @property
    def spiral(self) -> float:
        """The rightmost real root, where it is slow [rad/s]; nan where there is none."""
        real = self._real
        return float(real[0]) if real.size and real[0] > -_SLOW_ROOT else math.nan

    @property
    def roll_mode(self) -> float:
        """The fastest real root of the rigid body [rad/s]; nan where there is none but slow ones."""
        real = self._real
        return float(real[-1]) if real.size and real[-1] < -_SLOW_ROOT else math.nan

    @property
    def _real(self) -> npt.NDArray[np.float64]:
        return np.asarray(self.roots.real[(np.abs(self.roots.imag) < 1e-6) & (np.abs(self.roots) < _RIGID_ROOTS)])


def handling(aircraft: LpvAircraft, *, airspeed: float, nacelle: float, aids: tuple[AidName, ...]) -> Handling:
    """Linearize the aircraft with aids about its level trim.

    Args:
        aircraft: The LPV aircraft.
        aids: The aids that are on.
    """
    loop = symmetric_loop(aircraft, airspeed=airspeed, nacelle=nacelle, aids=aids)
    return Handling(loop.roots, _response(loop, "stick", "pitch", -1.0))


def lateral_handling(
    aircraft: LpvAircraft, *, airspeed: float, nacelle: float, aids: tuple[AidName, ...]
) -> LateralHandling:
    """Linearize the aircraft with aids about its level trim, out of the plane of symmetry.

    Args:
        aircraft: The LPV aircraft; its database must have a lateral half.
        aids: The aids that are on; heading and place are held in the roots, and let go where a control moves.
    """
    held, moved = (
        lateral_loop(aircraft, airspeed=airspeed, nacelle=nacelle, aids=aids, held=held) for held in (True, False)
    )
    roll, yaw = _response(moved, "lateral_stick", "bank", 1.0), _response(moved, "pedal", "heading", 1.0)
    return LateralHandling(held.roots, roll, yaw)


def _oscillation(roots: npt.NDArray[np.complex128]) -> complex:
    mid = roots[(roots.imag > 0.05) & (np.abs(roots) < 4.0)]
    return complex(mid[np.argmin(-mid.real / np.abs(mid))]) if mid.size else 0j


def _response(loop: LinearLoop, control: str, attitude: str, sign: float) -> Response:
    """ADS-33 bandwidth and phase delay of the response of an attitude that follows with a sign."""
    frequencies = np.geomspace(_LOWEST, _HIGHEST, 800)
    response = sign * loop.response(control, attitude, frequencies)
    phase = np.unwrap(np.angle(response))
    # Above the slow modes the phase comes down from -90 (rate) or 0 (attitude): count turns from there.
    start = int(np.searchsorted(frequencies, _CHECKED_FROM))
    phase -= 2.0 * math.pi * round((phase[start] + 0.5 * math.pi) / (2.0 * math.pi))
    frequencies, phase, gain = frequencies[start:], phase[start:], np.abs(response[start:])
    # A Dutch roll dips the phase below 180 deg and lets it come back: what counts is where it goes for good.
    half = np.arange(np.flatnonzero(np.append(True, phase >= -math.pi))[-1], phase.size)
    delay = 0.0
    if half.size:
        doubled = 2.0 * frequencies[half[0]]
        delay = float((-math.pi - np.interp(doubled, frequencies, phase)) / doubled)
    below = np.flatnonzero(phase < -0.75 * math.pi)
    if not below.size or below[0] == 0:
        return Response(0.0, delay)
    by_phase = float(frequencies[below[0]])
    if not half.size:
        return Response(by_phase, delay)
    gained = np.flatnonzero(gain < 2.0 * gain[half[0]])
    by_gain = float(frequencies[gained[0]]) if gained.size and gained[0] > 0 else by_phase
    return Response(min(by_phase, by_gain), delay)
