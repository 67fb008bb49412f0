"""The scheduled pilot in flat arrays: positions, tables, interpolation, the moving trim and what the pilot sees.

Legend:
    reference: What is asked for.
    hand: Number of the hand.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aircraft.variables import RIGID_BODY_STATES
from rtsim.arrays import FloatArray, IntArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.grid_kernels import bilinear
from rtsim.kernels.packed import Size
from rtsim.places import Places

TARGET = Places(
    "airspeed",  # filtered airspeed asked for [m/s]
    "airspeed_rate",  # [m/s^2]
    "altitude",  # [m]
    "climb_rate",  # [m/s]
    "nacelle_rate",  # commanded for the frame [rad/s]; the pilot's third channel, not used by the MOCM
    "turn_excess",  # load factor of the turn asked for, less 1
)
"""Places of what the pilot is asked for, ``reference``."""

LOOP_INTEGRATORS = 0
"""Airspeed and altitude held by integrators inside the design (default)."""
LOOP_PI = 1
"""Airspeed and altitude held by outer PI loops that move the state reference (the paper's structure)."""

NUMBER = Places(
    "gust_least",
    "filter",
    "acceleration_limit",
    "climb_speed",
    "kp_v",
    "ki_v",
    "kp_h",
    "ki_h",
    "z_v",
    "z_h",
    "dt",
)
"""Places in ``PilotTables.numbers``."""

PLANT = Places(*RIGID_BODY_STATES)
"""Places of the rigid body among the design plant's states."""
DISPLAYS = ("airspeed", "altitude", "climb_rate", "pitch", "pitch_rate")
"""What the pilot sees; with integrators also ``airspeed_integral`` and ``altitude_integral``."""
DISPLAY = Places(*DISPLAYS)
"""Places of the displays."""

SAME_CONTROL = 1e-9
"""Applied and demanded controls closer than this are the same (rounding must not freeze the integrals)."""
CAPTURE_FREQUENCY = 0.4
"""After taking over, the pilot leads its own reference from where the aircraft is to what is asked [rad/s]."""
CAPTURE_AIRSPEED_RATE = 1.5
"""Fastest capture of an airspeed [m/s^2]."""
CAPTURE_CLIMB = 4.0
"""Fastest capture of an altitude [m/s]."""
CAPTURE_AIRSPEED_JERK = 1.5
"""Largest rate of change of the capture's acceleration [m/s^3]."""
CAPTURE_CLIMB_RATE = 4.0
"""Largest vertical acceleration of the capture [m/s^2]."""
LARGEST_AIRSPEED_ERROR = 10.0
"""Farther from its reference the pilot gives the reference up and captures it again [m/s]."""
LARGEST_ALTITUDE_ERROR = 20.0
"""The same for altitude [m]."""
GIVE_WAY_TIME = 1.0
"""Time in which the own airspeed reference goes to the airspeed that the power at hand allows [s]."""
LEVER = 1
"""The hand on the power lever."""
OFFSETS = 4
"""Distance of the pilot's own reference from what is asked: airspeed, its rate, altitude, climb rate."""
INTEGRALS = 2
"""Airspeed and altitude are integrated."""
S_FILTERED = 0
"""Position in the state: filtered airspeed that schedules the gains [m/s]."""
S_LIMITED = 1
"""Position in the state: 1 while a hand was limited or overruled in the last frame."""
S_ESTIMATE = 2
"""Position in the state of the estimate; hands, delay filter, integrals and last reference follow."""


class PilotRoles(NamedTuple):
    """Loop, sizes and positions: constants to the compiler."""

    loop: Size
    """``LOOP_INTEGRATORS`` or ``LOOP_PI``."""
    plant: Size
    """States of the design plant."""
    delay: Size
    """States of the delay filter."""
    hands: Size
    """Controls."""
    displays: Size
    """What the pilot sees."""
    u: Size
    """Positions of the rigid body in the aircraft state."""
    w: Size
    q: Size
    pitch: Size
    altitude: Size
    a_columns: Size
    """Columns of A and of C that are kept."""
    c_columns: Size
    a: Size
    """Positions of the sections of a cell: dynamics, controls, nacelle, displays, filter, commands, lag, noise, end."""
    b: Size
    nacelle: Size
    c: Size
    f: Size
    l: Size  # noqa: E741 - the symbol of the design
    g: Size
    v: Size
    end: Size


class PilotTables(NamedTuple):
    """A scheduled pilot prepared by ``rtsim.pilot.tables.load_pilot_tables``; read-only."""

    airspeed: FloatArray
    """Airspeed axis (V,) [m/s]."""
    nacelle: FloatArray
    """Nacelle axis (N,) [rad]."""
    trim: FloatArray
    """[pitch, hands] of the level trim; coefficients of acceleration, its square; slopes with airspeed (V, N, k)."""
    loaded: FloatArray
    """What the trims at load factors above 1 add to pitch and hands, one load factor after the other (V, N, k)."""
    load_factor: FloatArray
    """These load factors (K,); none where the aircraft does not turn."""
    cells: FloatArray
    """Design plant and gains of each grid point, flattened by columns (V, N, block)."""
    a_columns: IntArray
    """Plant states with a column in A."""
    c_columns: IntArray
    """Plant states with a column in C."""
    lags: IntArray
    """Plant state that is the actuator lag of each hand; -1 where there is none (nu,)."""
    model_delay_a: FloatArray
    """Dynamics of the internal model's delay filter (nd, nd)."""
    delay_b: FloatArray
    """Input of the delay filters (nd, nu)."""
    model_delay_c: FloatArray
    """Output of the internal model's delay filter (nu, nd)."""
    delay_d: FloatArray
    """Feed-through of the delay filters (nu,)."""
    output_delay_a: FloatArray
    """Dynamics of the true delay filter, shorter by one frame (nd, nd)."""
    output_delay_c: FloatArray
    """Output of the true delay filter (nu, nd)."""
    limits: FloatArray
    """Rows: least, greatest, fastest [1/s]; columns: hands (3, nu)."""
    numbers: FloatArray
    """Scalars (``N_*``)."""
    roles: PilotRoles
    """Loop, sizes, positions of aircraft states and of the sections of a cell."""


@inner_kernel
def pad4(count: int) -> int:
    """Round up to a multiple of four, the width of a vector register.

    Args:
        count: A number of rows.

    Returns:
        The padded number.
    """
    return 4 * ((count + 3) // 4)


@inner_kernel
def pilot_state_size(tables: PilotTables) -> int:
    """Length of the pilot's state array.

    Returns:
        The number of float64 values.
    """
    roles = tables.roles
    estimate = roles.plant + roles.delay + roles.hands
    return int(S_ESTIMATE + estimate + roles.hands + roles.delay + INTEGRALS + roles.plant + OFFSETS)


@inner_kernel
def noise_width(tables: PilotTables) -> int:
    """Standard normals the pilot takes per frame when its noise is on: one per display and hand.

    Returns:
        The number.
    """
    return int(tables.roles.displays + tables.roles.hands)


@inner_kernel
def clip(value: float, limit: float) -> float:
    """Keep a value within plus and minus a limit.

    Args:
        value: The value.
        limit: The limit.
    """
    return min(limit, max(-limit, value))


@inner_kernel
def capture(state: FloatArray, place: int, limits: tuple[float, float], dt: float) -> None:
    """Lead one offset and its rate to zero: critically damped, its speed and acceleration limited.

    Args:
        state: The pilot's state.
        place: Place of the offset in it; its rate follows.
        limits: Largest speed and acceleration.
    """
    speed, acceleration = limits
    far = 2.0 * speed / CAPTURE_FREQUENCY
    offset = clip(state[place], far)
    change = clip(-CAPTURE_FREQUENCY * (CAPTURE_FREQUENCY * offset + 2.0 * state[place + 1]), acceleration)
    state[place] += dt * (state[place + 1] + 0.5 * dt * change)
    state[place + 1] += dt * change


@inner_kernel
def load_excess(reference: FloatArray) -> float:
    """Load factor of the turn asked for, less 1; 0 in a reference that does not know turns."""
    return reference[TARGET.turn_excess] if reference.shape[0] > TARGET.turn_excess else 0.0


@inner_kernel
def _add_load(tables: PilotTables, airspeed: float, nacelle_angle: float, excess: float, out: FloatArray) -> None:
    """Add what a turn needs to pitch and hands; the scratch of two orders of acceleration is free by now."""
    count = 1 + tables.roles.hands
    loads = tables.load_factor.shape[0]
    scratch = out[count:]
    bilinear(tables, tables.loaded, airspeed, nacelle_angle, loads * count, scratch)
    above, below = 0, 0.0
    while above < loads - 1 and excess > tables.load_factor[above] - 1.0:
        below = tables.load_factor[above] - 1.0
        above += 1
    share = min((excess - below) / (tables.load_factor[above] - 1.0 - below), 1.0)
    for k in range(count):
        before = 0.0 if above == 0 else scratch[count * (above - 1) + k]
        out[k] += before + share * (scratch[count * above + k] - before)


@inner_kernel
def commanded_trim(
    tables: PilotTables, reference: FloatArray, nacelle_angle: float, excess: float, out: FloatArray
) -> None:
    """Pitch and hands of the commanded trim.

    Args:
        excess: Load factor of the turn asked for, less 1.
        out: ``[:1 + nu]`` receives pitch and hands, ``[3 (1 + nu):4 (1 + nu)]`` their slopes with airspeed; the rest
            is scratch.
    """
    count = 1 + tables.roles.hands
    bilinear(tables, tables.trim, reference[TARGET.airspeed], nacelle_angle, 4 * count, out)
    limit = tables.numbers[NUMBER.acceleration_limit]
    a = min(limit, max(-limit, reference[TARGET.airspeed_rate]))
    for k in range(count):
        out[k] += a * (out[count + k] + a * out[2 * count + k])
    if excess > 0.0 and tables.load_factor.shape[0] > 0:
        _add_load(tables, reference[TARGET.airspeed], nacelle_angle, excess, out)
    # climbing keeps the angle of attack: pitch rises by the path angle, which fades out towards hover
    climb_speed = tables.numbers[NUMBER.climb_speed]
    speed = reference[TARGET.airspeed]
    out[0] += reference[TARGET.climb_rate] * speed / (speed * speed + climb_speed * climb_speed)


@inner_kernel
def own_reference(state: FloatArray, reference: FloatArray, out: FloatArray) -> None:
    """Write what is asked for plus the offset of a capture in progress (zero in ordinary flight).

    Args:
        out: Receives airspeed, airspeed rate, altitude and climb rate.
    """
    first = state.shape[0] - OFFSETS
    for k in range(OFFSETS):
        out[k] = reference[k] + state[first + k]


@inner_kernel
def observe(
    tables: PilotTables, x: FloatArray, reference: FloatArray, pitch: float, pitch_rate: float, out: FloatArray
) -> float:
    """Write the deviations of the displays from the reference; the integrals are not among them.

    Args:
        pitch: Pitch of the moving trim [rad].
        pitch_rate: Its rate [rad/s].
        out: Receives deviations of airspeed, altitude, climb rate, pitch, pitch rate.

    Returns:
        The airspeed [m/s].
    """
    roles = tables.roles
    sine = math.sin(x[roles.pitch])
    cosine = math.cos(x[roles.pitch])
    u = x[roles.u]
    w = x[roles.w]
    airspeed = u * cosine + w * sine
    out[DISPLAY.airspeed] = airspeed - reference[TARGET.airspeed]
    out[DISPLAY.altitude] = x[roles.altitude] - reference[TARGET.altitude]
    out[DISPLAY.climb_rate] = u * sine - w * cosine - reference[TARGET.climb_rate]
    out[DISPLAY.pitch] = x[roles.pitch] - pitch
    out[DISPLAY.pitch_rate] = x[roles.q] - pitch_rate
    return float(airspeed)


@inner_kernel
def plant_reference(
    tables: PilotTables, reference: FloatArray, trim: FloatArray, pitch_rate: float, out: FloatArray
) -> None:
    """Write the moving trim in the design plant's states.

    Args:
        trim: Pitch and hands, from `commanded_trim`.
        pitch_rate: Rate of the trim's pitch [rad/s].
        out: Receives the plant states.
    """
    roles = tables.roles
    sine = math.sin(trim[0])
    cosine = math.cos(trim[0])
    for k in range(roles.plant):
        out[k] = 0.0
    out[PLANT.u] = reference[TARGET.airspeed] * cosine + reference[TARGET.climb_rate] * sine
    out[PLANT.w] = reference[TARGET.airspeed] * sine - reference[TARGET.climb_rate] * cosine
    out[PLANT.q] = pitch_rate
    out[PLANT.pitch] = trim[0]
    out[PLANT.altitude] = reference[TARGET.altitude]
    for hand in range(roles.hands):
        if tables.lags[hand] >= 0:
            out[tables.lags[hand]] = trim[1 + hand]


@inner_kernel
def outer_command(
    tables: PilotTables, cell: FloatArray, trim: FloatArray, airspeed: float, dv: float, dh: float, hand: int
) -> float:
    """Say what a hand is asked for by moving the reference to a trim dv faster, and dh upwards.

    The whole trim moves, pitch and controls too: moving only the speed has the wrong sign on the back side of the power
    curve, where slower flight takes more power.

    Args:
        cell: Gains.
        trim: Pitch, hands and their slopes, from `commanded_trim`.
        airspeed: Commanded airspeed [m/s].
        dv: Airspeed command of the outer loop [m/s].
        dh: Altitude command of the outer loop [m].

    Returns:
        The hand's command.
    """
    hands = tables.roles.hands
    slopes = 3 * (1 + hands)
    place = tables.roles.l + hand
    sine = math.sin(trim[0])
    cosine = math.cos(trim[0])
    pitch_slope = trim[slopes]
    along = trim[slopes + 1 + hand]
    along += cell[place] * (cosine - airspeed * sine * pitch_slope)
    along += cell[place + hands] * (sine + airspeed * cosine * pitch_slope)
    along += cell[place + 3 * hands] * pitch_slope
    for other in range(hands):
        if tables.lags[other] >= 0:
            along += cell[place + hands * tables.lags[other]] * trim[slopes + 1 + other]
    return float(along * dv + cell[place + 4 * hands] * dh)


@inner_kernel
def demand(tables: PilotTables, state: FloatArray, hand: int) -> float:
    """Deviation of a hand's control after the true delay."""
    roles = tables.roles
    delay = roles.delay
    hands_at = S_ESTIMATE + roles.plant + delay + roles.hands
    delay_at = hands_at + roles.hands
    total = tables.delay_d[hand] * state[hands_at + hand]
    for k in range(delay):
        total += tables.output_delay_c[hand, k] * state[delay_at + k]
    return float(total)
