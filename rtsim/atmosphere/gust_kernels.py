"""Compiled gusts: turbulence and discrete gusts together, turned into the body axes of the plant's gust inputs.

A gust is given by what the aircraft feels: ``ahead`` [m/s] adds to the airspeed (a headwind), ``below`` [m/s] is air
rising from below (an updraft), ``right`` [m/s] air from the right. All are positive additions to the air-relative
velocity, forward, down and right.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.arrays import FloatArray
from rtsim.atmosphere.dryden_kernels import TURBULENCE, TurbulenceTables, turbulence_step
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places

GUST = Places(
    ("turbulence", TURBULENCE.size),
    "u",  # gust along body x of the present frame [m/s]
    "w",  # gust along body z [m/s]
    "q",  # pitch gust [rad/s]
    "ahead",  # horizontal gust, from ahead positive: what an airspeed indicator sees of it [m/s]
    "below",  # vertical gust, from below positive [m/s]
    "v",  # gust along body y [m/s]
    "p",  # roll gust [rad/s]
    "r",  # yaw gust [rad/s]
    "right",  # horizontal gust, from the right positive [m/s]
    "busy",  # 1 while there has been turbulence or a gust is acting or to come; 0: a frame may leave gust_step out
)
"""Places in the gust state: turbulence, what acts now; then one block for each discrete gust."""

SLOT = Places(
    "shape",
    "start",  # [s]
    "first",  # amplitude from ahead, or along body x [m/s]
    "second",  # amplitude from below, or along body z [m/s]
    "third",  # amplitude from the right, or along body y [m/s]
    "extent",  # duration [s] or length [m] of the pulse or of the rise
    "by_length",  # 1 if the extent is a length
    "body",  # 1 if the amplitudes are along the body axes
    "travelled",  # how far the gust has been entered, in the unit of the extent
)
"""Places in the block of a discrete gust."""

SHAPE_NONE, SHAPE_ONE_MINUS_COSINE, SHAPE_BUILD_UP, SHAPE_RAMP = 0, 1, 2, 3

NORMALS_PER_FRAME = 3
"""Standard normals that the turbulence takes per frame; as many again, of a stream of their own, that of the side."""


class GustTables(NamedTuple):
    """Parameters of the gusts; read-only. The gusts themselves stand in the state, so that a flight can add some."""

    turbulence: TurbulenceTables
    """Parameters of the turbulence."""


@inner_kernel
def gust_shape(shape: float, entered: float, extent: float) -> float:
    """How much of its amplitude a gust has at a place.

    Args:
        shape: One of ``SHAPE_*``.
        entered: How far the gust has been entered; negative before it.
        extent: Length of the pulse (there and back) or of the rise, in the same unit; 0 is a sharp edge.

    Returns:
        The share, 0 to 1.
    """
    if shape == SHAPE_NONE or entered < 0.0:
        return 0.0
    if shape == SHAPE_ONE_MINUS_COSINE:
        if entered >= extent:
            return 0.0
        return 0.5 * (1.0 - math.cos(2.0 * math.pi * entered / extent))
    if entered >= extent:
        return 1.0
    if shape == SHAPE_BUILD_UP:
        return 0.5 * (1.0 - math.cos(math.pi * entered / extent))
    return entered / extent


@inner_kernel
def gust_step(
    tables: GustTables,
    state: FloatArray,
    airspeed: float,
    altitude: float,
    attitude: tuple[float, float],
    time: float,
    dt: float,
    normals: FloatArray,
) -> None:
    """Move the gusts on to a time; afterwards the state says what acts during the frame that starts there.

    Args:
        state: Gust state, updated in place; what acts is exactly 0.0 where there is nothing.
        airspeed: Speed through the undisturbed air [m/s].
        attitude: Pitch and bank [rad].
        time: Time at the start of the frame [s].
        dt: Length of the frame that ends at ``time``; 0 at the start of the flight [s].
        normals: Standard normals, shape (3,), (6,) with lateral turbulence; not read without turbulence.
    """
    ahead, below, rate, right, roll, yaw = turbulence_step(tables.turbulence, state, airspeed, altitude, dt, normals)
    along_x = along_y = along_z = 0.0
    busy = state[TURBULENCE.active]
    through = max(abs(airspeed), tables.turbulence.minimum_speed)
    for slot in range(GUST.size, state.shape[0], SLOT.size):
        shape = state[slot + SLOT.shape]
        since = time - state[slot + SLOT.start]
        if shape == SHAPE_NONE:
            continue
        busy = 1.0
        if since < 0.0:
            continue
        if state[slot + SLOT.by_length] != 0.0:
            # A gust that begins within a frame is entered for the rest of that frame only.
            state[slot + SLOT.travelled] += through * min(dt, since)
        else:
            state[slot + SLOT.travelled] = since
        extent = state[slot + SLOT.extent]
        share = gust_shape(shape, state[slot + SLOT.travelled], extent)
        if shape == SHAPE_ONE_MINUS_COSINE and state[slot + SLOT.travelled] >= extent:
            state[slot + SLOT.shape] = SHAPE_NONE
        if state[slot + SLOT.body] != 0.0:
            along_x += share * state[slot + SLOT.first]
            along_z += share * state[slot + SLOT.second]
            along_y += share * state[slot + SLOT.third]
        else:
            ahead += share * state[slot + SLOT.first]
            below += share * state[slot + SLOT.second]
            right += share * state[slot + SLOT.third]
    state[GUST.busy] = busy
    calm = ahead == 0.0 and below == 0.0 and right == 0.0 and rate == 0.0 and roll == 0.0 and yaw == 0.0
    if calm and along_x == 0.0 and along_y == 0.0 and along_z == 0.0:
        for place in range(GUST.u, GUST.busy):
            state[place] = 0.0
        return
    sine, cosine = math.sin(attitude[0]), math.cos(attitude[0])
    bank_sine, bank_cosine = math.sin(attitude[1]), math.cos(attitude[1])
    # Between the two turns, of pitch and of bank: x along the body, y along the horizon.
    upright = ahead * sine + below * cosine
    upright_z = along_y * bank_sine + along_z * bank_cosine
    # + 0.0 turns a negative zero into zero: a gust of nothing is the same number as no gust.
    state[GUST.u] = (ahead * cosine - below * sine + along_x) + 0.0
    state[GUST.v] = (right * bank_cosine + upright * bank_sine + along_y) + 0.0
    state[GUST.w] = (upright * bank_cosine - right * bank_sine + along_z) + 0.0
    state[GUST.p], state[GUST.q], state[GUST.r] = roll + 0.0, rate + 0.0, yaw + 0.0
    state[GUST.ahead] = (ahead + along_x * cosine + upright_z * sine) + 0.0
    state[GUST.below] = (below + upright_z * cosine - along_x * sine) + 0.0
    state[GUST.right] = (right + along_y * bank_cosine - along_z * bank_sine) + 0.0
