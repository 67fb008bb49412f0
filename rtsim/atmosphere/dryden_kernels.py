"""Compiled Dryden turbulence: intensities and scale lengths of MIL-F-8785C, and filters exact at every frame.

The air is a frozen field that the aircraft flies through, so a filter knows only the distance flown over its scale
length, ``s = V dt / L``. Its states have unit variance *whatever s is*; speed and height change how far a frame
reaches into the field, never the variance, and intensity only scales the output. A change of speed or height therefore
leaves no transient. Derivation and tests: docs/atmosphere.md.

Legend: h height [m], W20 wind at 20 ft [m/s], L scale length [m], sigma intensity [m/s], s distance over scale length,
z state of unit variance, n standard normal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places
from rtsim.units import FOOT

LOW_ALTITUDE = 1000.0 * FOOT
"""Up to this height the low-altitude model holds [m]."""
HIGH_ALTITUDE = 2000.0 * FOOT
"""From this height on the medium/high-altitude model holds; between the two both are interpolated [m]."""
LOWEST_ALTITUDE = 10.0 * FOOT
"""The low-altitude model is not defined below; its values there are used [m]."""
HIGH_SCALE = 1750.0 * FOOT
"""Scale length of the medium/high-altitude model in Dryden form [m]."""

TURBULENCE = Places(
    "wind",  # wind at 20 ft in force [m/s]; 0 is no turbulence
    "wind_target",  # wind at 20 ft that it moves to [m/s]
    "wind_rate",  # size of its rate of change [m/s^2]
    "u",  # state of the longitudinal filter
    "w_1",  # states of the vertical filter
    "w_2",
    "lag",  # vertical gust behind the lag of the pitch gust [m/s]
    "w",  # vertical gust of the present frame [m/s]
    "active",  # 1 once there has been turbulence: normals are drawn every frame from then on
    "lateral",  # 1: gusts from the side, in roll and in yaw too
    "v_1",  # states of the filter from the side
    "v_2",
    "p",  # state of the roll filter
    "v_lag",  # gust from the side behind the lag of the yaw gust [m/s]
    "v",  # gust from the side of the present frame [m/s]
)
"""Places in the gust state's turbulence section."""

# Output weights of the vertical filter: cos 15 deg and -sin 15 deg, see docs/atmosphere.md.
_W_FIRST = (1.0 + math.sqrt(3.0)) / math.sqrt(8.0)
_W_SECOND = (1.0 - math.sqrt(3.0)) / math.sqrt(8.0)


class TurbulenceTables(NamedTuple):
    """Parameters of the turbulence; read-only."""

    span: float
    """Wing span, sets the lags of the pitch and the yaw gust and how far the roll gust reaches [m]."""
    minimum_speed: float
    """Speed through the frozen field where the aircraft is slower [m/s]."""
    altitude: FloatArray
    """Heights of the intensity curves, ascending, shape (a,) [m]."""
    wind: FloatArray
    """Wind at 20 ft that goes with each intensity curve, ascending from 0, shape (c,) [m/s]."""
    intensity: FloatArray
    """Intensity of the medium/high-altitude model, shape (c, a) [m/s]; the curve for no wind is zero."""


@inner_kernel
def high_altitude_intensity(tables: TurbulenceTables, altitude: float, wind: float) -> float:
    """Intensity of the medium/high-altitude model: linear in height and between the curves, held beyond in height.

    Beyond the strongest curve the intensity grows in proportion to the wind.

    Args:
        wind: Wind at 20 ft that names the severity [m/s].

    Returns:
        The root-mean-square gust of each component [m/s].
    """
    last = tables.altitude.shape[0] - 1
    i = 0
    while i < last - 1 and tables.altitude[i + 1] <= altitude:
        i += 1
    share = (altitude - tables.altitude[i]) / (tables.altitude[i + 1] - tables.altitude[i])
    share = min(1.0, max(0.0, share))
    strongest = tables.wind.shape[0] - 1
    j = 0
    while j < strongest - 1 and tables.wind[j + 1] <= wind:
        j += 1
    below = tables.intensity[j, i] + share * (tables.intensity[j, i + 1] - tables.intensity[j, i])
    above = tables.intensity[j + 1, i] + share * (tables.intensity[j + 1, i + 1] - tables.intensity[j + 1, i])
    if wind > tables.wind[strongest]:
        return above * wind / tables.wind[strongest]
    return below + (wind - tables.wind[j]) / (tables.wind[j + 1] - tables.wind[j]) * (above - below)


@inner_kernel
def turbulence_scales(tables: TurbulenceTables, altitude: float, wind: float) -> tuple[float, float, float, float]:
    """Intensities and scale lengths at a height (MIL-F-8785C 3.7.2 and 3.7.3.4).

    Args:
        wind: Wind at 20 ft [m/s].

    Returns:
        Longitudinal and vertical intensity [m/s], longitudinal and vertical scale length [m].
    """
    height = min(max(altitude, LOWEST_ALTITUDE), LOW_ALTITUDE)
    shape = 0.177 + 0.000823 * height / FOOT
    sigma_w = 0.1 * wind
    sigma_u = sigma_w / shape**0.4
    scale_u = height / shape**1.2
    scale_w = height
    if altitude > LOW_ALTITUDE:
        share = min(1.0, (altitude - LOW_ALTITUDE) / (HIGH_ALTITUDE - LOW_ALTITUDE))
        sigma = high_altitude_intensity(tables, max(altitude, HIGH_ALTITUDE), wind)
        sigma_u += share * (sigma - sigma_u)
        sigma_w += share * (sigma - sigma_w)
        scale_u += share * (HIGH_SCALE - scale_u)
        scale_w += share * (HIGH_SCALE - scale_w)
    return sigma_u, sigma_w, scale_u, scale_w


@inner_kernel
def sinh_excess(s: float) -> float:
    """``sinh(s)**2 - s**2`` without cancellation; the variance that only the second normal explains.

    Args:
        s: Distance over scale length, not negative.
    """
    if s > 0.2:
        return math.sinh(s) ** 2 - s * s
    square = s * s
    excess = s * square / 6.0 * (1.0 + square / 20.0 * (1.0 + square / 42.0 * (1.0 + square / 72.0)))
    return excess * (2.0 * s + excess)


@inner_kernel
def advance_first_order(z: float, s: float, n: float) -> float:
    """Move the longitudinal filter by a distance; exact in distribution for any distance.

    Args:
        z: State.
        s: Distance over scale length, not negative.
        n: Standard normal.

    Returns:
        The new state; its variance stays 1.
    """
    return z * math.exp(-s) + math.sqrt(-math.expm1(-2.0 * s)) * n


@inner_kernel
def advance_second_order(z1: float, z2: float, s: float, n1: float, n2: float) -> tuple[float, float]:
    """Move the vertical filter by a distance; exact in distribution for any distance.

    The states obey ``dz1 = -z1 ds + sqrt(2) dB``, ``dz2 = (2 z1 - z2) ds - sqrt(2) dB``: their stationary covariance
    is the identity, so the noise of a frame has the covariance ``1 - F F'`` with ``F = exp(-s) [[1, 0], [2 s, 1]]``.

    Args:
        z1: First state.
        z2: Second state.
        s: Distance over scale length, not negative.
        n1: Standard normal.
        n2: Standard normal.

    Returns:
        The new states; their covariance stays the identity.
    """
    if s <= 0.0:
        return z1, z2
    decay = math.exp(-s)
    lost = decay * decay
    variance = -math.expm1(-2.0 * s)
    first = math.sqrt(variance)
    cross = -2.0 * s * lost / first
    second = 2.0 * decay * math.sqrt(sinh_excess(s) / variance)
    return decay * z1 + first * n1, decay * (2.0 * s * z1 + z2) + cross * n1 + second * n2


@inner_kernel
def advance_lag(lag: float, before: float, now: float, a: float) -> float:
    """Move a first-order lag by one frame over which its input is a straight line.

    Args:
        lag: Output of the lag at the start of the frame.
        before: Input at the start of the frame.
        now: Input at the end of the frame.
        a: Length of the frame over the time constant, above 0.

    Returns:
        The output at the end of the frame.
    """
    gone = -math.expm1(-a)
    return lag + gone * (before - lag) + (1.0 - gone / a) * (now - before)


@inner_kernel
def roll_intensity(span: float, sigma_w: float, scale_w: float) -> float:
    """Root-mean-square roll gust: the integral of its spectrum (MIL-F-8785C 3.7.1.4) [rad/s].

    Args:
        span: Wing span [m].
        sigma_w: Vertical intensity [m/s].
        scale_w: Vertical scale length [m].
    """
    share = math.pi * scale_w / (4.0 * span)
    return sigma_w * math.sqrt(0.8 * share ** (1.0 / 3.0) * math.pi**2 / (8.0 * span * scale_w))


@inner_kernel
def lateral_step(
    tables: TurbulenceTables,
    state: FloatArray,
    scales: tuple[float, float, float, float],
    distance: float,
    normals: FloatArray,
) -> tuple[float, float, float]:
    """Move the turbulence of side, roll and yaw on by a distance and give it there.

    From the side intensity and scale length are the longitudinal ones at every height, and the form is the vertical
    one (MIL-F-8785C 3.7.2.1, 3.7.3.4).

    Args:
        state: State, updated in place.
        scales: What ``turbulence_scales`` gives.
        distance: Way through the air since the frame before; 0 at the start of the flight [m].
        normals: Standard normals; the last three are used.

    Returns:
        Gust from the right [m/s], roll and yaw gust [rad/s].
    """  # fmt: skip
    sigma_v, sigma_w, scale_v, scale_w = scales
    state[TURBULENCE.v_1], state[TURBULENCE.v_2] = advance_second_order(
        state[TURBULENCE.v_1], state[TURBULENCE.v_2], distance / scale_v, normals[3], normals[4]
    )
    reach = 4.0 * tables.span / math.pi
    state[TURBULENCE.p] = advance_first_order(state[TURBULENCE.p], distance / reach, normals[5])
    side = sigma_v * (_W_FIRST * state[TURBULENCE.v_1] + _W_SECOND * state[TURBULENCE.v_2])
    behind = 3.0 * tables.span / math.pi
    if distance > 0.0:
        state[TURBULENCE.v_lag] = advance_lag(state[TURBULENCE.v_lag], state[TURBULENCE.v], side, distance / behind)
    else:
        state[TURBULENCE.v_lag] = side
    state[TURBULENCE.v] = side
    roll = roll_intensity(tables.span, sigma_w, scale_w) * state[TURBULENCE.p]
    return side, roll, (side - state[TURBULENCE.v_lag]) / behind


@inner_kernel
def turbulence_step(
    tables: TurbulenceTables, state: FloatArray, speed: float, altitude: float, dt: float, normals: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Move the turbulence on by a frame and give it there.

    Args:
        state: State, updated in place; its first ``TURBULENCE.size`` entries are used.
        speed: Airspeed; its size counts, and at least ``minimum_speed`` [m/s].
        dt: Length of the frame that ends now; 0 at the start of the flight [s].
        normals: Three standard normals, six with lateral turbulence; not read without turbulence.

    Returns:
        Gust from ahead and from below [m/s], pitch gust [rad/s], gust from the right [m/s], roll and yaw gust [rad/s];
        exactly 0.0 without turbulence, the last three without lateral turbulence.
    """
    if state[TURBULENCE.active] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    change = state[TURBULENCE.wind_rate] * dt
    wind = state[TURBULENCE.wind]
    if wind < state[TURBULENCE.wind_target]:
        wind = min(state[TURBULENCE.wind_target], wind + change)
    elif wind > state[TURBULENCE.wind_target]:
        wind = max(state[TURBULENCE.wind_target], wind - change)
    state[TURBULENCE.wind] = wind
    scales = turbulence_scales(tables, altitude, wind)
    sigma_u, sigma_w, scale_u, scale_w = scales
    through = max(abs(speed), tables.minimum_speed)
    distance = through * dt
    state[TURBULENCE.u] = advance_first_order(state[TURBULENCE.u], distance / scale_u, normals[0])
    state[TURBULENCE.w_1], state[TURBULENCE.w_2] = advance_second_order(
        state[TURBULENCE.w_1], state[TURBULENCE.w_2], distance / scale_w, normals[1], normals[2]
    )
    vertical = sigma_w * (_W_FIRST * state[TURBULENCE.w_1] + _W_SECOND * state[TURBULENCE.w_2])
    reach = 4.0 * tables.span / math.pi
    if dt > 0.0:
        state[TURBULENCE.lag] = advance_lag(state[TURBULENCE.lag], state[TURBULENCE.w], vertical, distance / reach)
    else:
        state[TURBULENCE.lag] = vertical
    state[TURBULENCE.w] = vertical
    side = roll = yaw = 0.0
    if state[TURBULENCE.lateral] != 0.0:
        side, roll, yaw = lateral_step(tables, state, scales, distance, normals)
    if wind == 0.0 and state[TURBULENCE.wind_target] == 0.0:
        # Calmed down: the gusts themselves are over, the lags of pitch and yaw gust with them.
        state[TURBULENCE.lag] = state[TURBULENCE.v_lag] = 0.0
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return sigma_u * state[TURBULENCE.u], vertical, -(vertical - state[TURBULENCE.lag]) / reach, side, roll, yaw
