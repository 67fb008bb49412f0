"""Compiled pilot aids: what acts between the pilot's hands and the control mixing.

Signs: stick forward (positive) pitches down, so a positive gain on pitch and pitch rate is restoring. Gains are
accelerations wanted over accelerations the controls give (``design.py``), so one handling target holds everywhere.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.kernels.grid_kernels import cell
from rtsim.places import Places

# Places in the switches; 1 on, 0 off.
RATE_DAMPING, ATTITUDE_RETENTION, ALTITUDE_HOLD, AIRSPEED_HOLD, TRIM_BIAS = 0, 1, 2, 3, 4
ROLL_DAMPING, YAW_DAMPING, BANK_RETENTION, HEADING_HOLD, TURN_COORDINATION, POSITION_HOLD = 5, 6, 7, 8, 9, 10
AID_COUNT = 11
"""Aids that act on the controls; the switches of flaps and rotor drive follow."""
AUTOMATIC_FLAPS, GOVERNOR, AUTOMATIC_ROTOR_SPEED = 11, 12, 13
SWITCH_COUNT = 14
MEMORY = Places(
    "pitch_reference",
    "altitude_reference",
    "airspeed_reference",
    "altitude_integral",
    "airspeed_integral",
    "schedule_airspeed",
    "lever_reference",
    "stick_offset",
    "lever_offset",
    "hands_lever",
    "lever_trim",
    "lateral_offset",  # what is left of the last hand-over; NaN: to be found in the coming frame
    "pedal_offset",
    "bank_reference",
    "heading_reference",
    "heading_integral",  # pedal
    "heading_held",  # 1 while the heading is held, 0 while it is the hands'
    "north_reference",
    "east_reference",
    "north_integral",  # acceleration
    "east_integral",
    "last_north",
    "last_east",
    "quiet_time",  # since when the hands have left the place alone
    "place_share",  # how much of bank and pitch is the place's: 0 while it is the hands', 1 while it is held
    "place_bank",
    "place_pitch",
    ("last_switches", AID_COUNT),
)
"""Places in the state."""
MAP = Places(
    "stick",
    "pitch_sensitivity",
    "pitch_damping",
    "lever_lift",
    "lever_thrust",
    "lever",
    ("stick_flaps", 3),  # one for each interval between flap settings
)
"""Layers of ``AidTables.maps``."""

CLIMB_PER_HEIGHT = 0.2
"""Climb rate asked for per height error in airplane mode [1/s]."""
FASTEST_CLIMB = 5.0
"""Largest climb rate altitude hold asks for, however far the height is off [m/s]."""
PATH_TIME = 3.0
"""Time in which the attitude altitude hold flies about follows the flight path in airplane mode [s]."""


class AidTables(NamedTuple):
    """Schedules and targets of the aids. SI and radians."""

    airspeed: FloatArray
    """Airspeed axis [m/s]."""
    nacelle: FloatArray
    """Nacelle axis [rad]."""
    maps: FloatArray
    """Trim stick, pitch acceleration per stick and pitch rate, climb and forward acceleration per lever, trim
    lever, stick that answers the moment of the flaps in each interval; (MAP_COUNT, V, N)."""
    schedule_time: float
    """Time constant of the airspeed that schedules the aids [s]."""
    damping: float
    """Pitch damping the rate damper aims at [1/s]."""
    attitude_frequency: float
    """Natural frequency of attitude retention [rad/s]."""
    attitude_damping: float
    """Damping ratio of attitude retention."""
    authority: float
    """Largest part of the stick the damper and the retention may add."""
    rate_command: float
    """Pitch rate commanded by full stick with attitude retention on [rad/s]."""
    dead_zone: float
    """Stick and lever deflections below this leave the references alone."""
    altitude_frequency: float
    """Natural frequency of altitude hold [rad/s]."""
    airspeed_frequency: float
    """Bandwidth of airspeed hold [rad/s]."""
    integral_time: float
    """Time constant of both holds' integrals [s]."""
    fade_time: float
    """Time in which what a switched aid added fades from or into the hands' part [s]."""
    blend: tuple[float, float]
    """Nacelle angles between which altitude passes from stick (airplane) to lever (helicopter) [rad]."""


@inner_kernel
def scheduled(tables: Any, which: int, airspeed: float, nacelle: float) -> float:
    """Value of one map at a flight condition, bilinear and held outside the grid.

    Args:
        tables: Has the axes ``airspeed`` [m/s] and ``nacelle`` [rad], and ``maps``.
        which: Number of the map.
    """
    i, s = cell(tables.airspeed, airspeed)
    j, t = cell(tables.nacelle, nacelle)
    m = tables.maps
    return (1.0 - s) * ((1.0 - t) * m[which, i, j] + t * m[which, i, j + 1]) + s * (
        (1.0 - t) * m[which, i + 1, j] + t * m[which, i + 1, j + 1]
    )


@inner_kernel
def beyond(value: float, dead_zone: float) -> float:
    """The part of a deflection beyond the dead zone, rescaled to full travel.

    Args:
        value: Deflection.
        dead_zone: Where it begins to count.
    """
    if abs(value) <= dead_zone:
        return 0.0
    return math.copysign((abs(value) - dead_zone) / (1.0 - dead_zone), value)


@inner_kernel
def limited(value: float, limit: float) -> float:
    """A value no larger than a limit, either way.

    Args:
        value: Anything.
        limit: The limit of its magnitude.
    """
    return min(max(value, -limit), limit)


@inner_kernel
def _share(tables: AidTables, nacelle: float) -> float:
    """1 where the lever holds the height (helicopter), 0 where pitch does (airplane), smooth between."""
    start, end = tables.blend
    share = min(max((nacelle - start) / (end - start), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@inner_kernel
def _path_error(state: FloatArray, x: FloatArray) -> float:
    """Change of pitch that altitude hold asks for in airplane mode, where the path follows pitch [rad]."""
    st, ct = math.sin(x[STATE.pitch]), math.cos(x[STATE.pitch])
    airspeed, climb = x[STATE.u] * ct + x[STATE.w] * st, x[STATE.u] * st - x[STATE.w] * ct
    wanted = limited(CLIMB_PER_HEIGHT * (state[MEMORY.altitude_reference] - x[STATE.altitude]), FASTEST_CLIMB)
    return limited((wanted - climb) / max(abs(airspeed), 20.0), 0.12)


@inner_kernel
def _changed(state: FloatArray, switches: FloatArray) -> bool:
    """Whether a switch was moved since the last frame, or the aids have not begun."""
    changed = False
    for i in range(AID_COUNT):
        changed = changed or switches[i] != state[MEMORY.last_switches + i]
    return changed


@inner_kernel
def aids_airspeed(state: FloatArray, switches: FloatArray, x: FloatArray) -> float:
    """Airspeed that schedules the aids in this frame: the present one where they begin anew [m/s].

    Args:
        state: Their state before ``aids_step``.
        switches: Which are on.
    """
    if _changed(state, switches):
        return x[STATE.u] * math.cos(x[STATE.pitch]) + x[STATE.w] * math.sin(x[STATE.pitch])
    return float(state[MEMORY.schedule_airspeed])


@inner_kernel
def _terms(
    tables: AidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    hands: FloatArray,
    flaps: FloatArray,
) -> tuple[float, float, float, float]:
    """Stick and lever with the aids as switched, and the two hold errors (altitude [m], airspeed [m/s])."""
    pitch, q = x[STATE.pitch], x[STATE.q]
    st, ct = math.sin(pitch), math.cos(pitch)
    airspeed = x[STATE.u] * ct + x[STATE.w] * st
    climb = x[STATE.u] * st - x[STATE.w] * ct
    at = state[MEMORY.schedule_airspeed]
    share = _share(tables, nacelle)
    height_error = state[MEMORY.altitude_reference] - x[STATE.altitude]
    speed_error = state[MEMORY.airspeed_reference] - airspeed

    # A hold has the lever in its half of the flight and moves it with the trim; in the other half it is the hands'.
    helicopter_lever = airplane_lever = hands[1]
    pitch_wanted = state[MEMORY.pitch_reference]
    if switches[ALTITUDE_HOLD] != 0.0 or switches[AIRSPEED_HOLD] != 0.0:
        held = state[MEMORY.lever_reference] + scheduled(tables, MAP.lever, at, nacelle) - state[MEMORY.lever_trim]
        if switches[ALTITUDE_HOLD] != 0.0:
            w = tables.altitude_frequency
            wanted = limited(w * w * height_error - 1.6 * w * climb, 2.5) + state[MEMORY.altitude_integral]
            lift = max(scheduled(tables, MAP.lever_lift, at, nacelle), 4.0)
            helicopter_lever = held + wanted / lift
            pitch_wanted += (1.0 - share) * _path_error(state, x)
        if switches[AIRSPEED_HOLD] != 0.0:
            wanted = tables.airspeed_frequency * speed_error + state[MEMORY.airspeed_integral]
            wanted = limited(wanted, 1.5)
            pitch_wanted -= share * wanted / 9.81
            thrust = max(scheduled(tables, MAP.lever_thrust, at, nacelle), 10.0)
            airplane_lever = held + wanted / thrust
    lever = share * helicopter_lever + (1.0 - share) * airplane_lever

    sensitivity = min(scheduled(tables, MAP.pitch_sensitivity, at, nacelle), -0.3)
    natural = min(scheduled(tables, MAP.pitch_damping, at, nacelle), 0.0)
    stick = hands[0]
    if switches[TRIM_BIAS] != 0.0:
        stick += scheduled(tables, MAP.stick, at, nacelle)
        for k in range(3):
            if flaps[k] != 0.0:
                stick += scheduled(tables, MAP.stick_flaps + k, at, nacelle) * flaps[k]
    if switches[POSITION_HOLD] != 0.0:
        pitch_wanted += state[MEMORY.place_share] * (state[MEMORY.place_pitch] - pitch_wanted)
    attitude = switches[ATTITUDE_RETENTION] + switches[ALTITUDE_HOLD] * (1.0 - share) + switches[AIRSPEED_HOLD] * share
    attitude += switches[POSITION_HOLD]
    added = 0.0
    if attitude > 0.0:
        w = tables.attitude_frequency
        rate_wanted = -tables.rate_command * beyond(hands[0], tables.dead_zone)
        damping = max(2.0 * tables.attitude_damping * w + natural, 0.0)
        added = (w * w * (pitch_wanted - pitch) + damping * (rate_wanted - q)) / sensitivity
        # The hands command the rate through the reference; their direct part would act twice.
        stick -= hands[0]
    elif switches[RATE_DAMPING] != 0.0:
        added = -max(tables.damping + natural, 0.0) * q / sensitivity
    return stick + limited(added, tables.authority), lever, height_error, speed_error


@inner_kernel
def aids_engage(
    tables: AidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    hands: FloatArray,
    flaps: FloatArray,
    acting: FloatArray,
) -> None:
    """Start or re-start the aids from the present flight so that the acting controls do not step.

    Args:
        state: Their state; overwritten.
        switches: Which are on.
        hands: Stick and lever as the pilot holds them.
        flaps: Deflection in each interval between settings less that of the schedule at the aids' airspeed [rad].
        acting: Stick and lever that acted last.
    """
    airspeed = x[STATE.u] * math.cos(x[STATE.pitch]) + x[STATE.w] * math.sin(x[STATE.pitch])
    state[MEMORY.pitch_reference] = x[STATE.pitch]
    state[MEMORY.altitude_reference] = x[STATE.altitude]
    state[MEMORY.airspeed_reference] = airspeed
    state[MEMORY.altitude_integral] = 0.0
    state[MEMORY.airspeed_integral] = 0.0
    state[MEMORY.schedule_airspeed] = airspeed
    state[MEMORY.lever_reference] = acting[1]
    state[MEMORY.hands_lever] = hands[1]
    state[MEMORY.lever_trim] = scheduled(tables, MAP.lever, airspeed, nacelle)
    stick, lever, _, _ = _terms(tables, state, switches, x, nacelle, hands, flaps)
    state[MEMORY.stick_offset] = acting[0] - stick
    state[MEMORY.lever_offset] = acting[1] - lever
    for i in range(AID_COUNT):
        state[MEMORY.last_switches + i] = switches[i]


@inner_kernel
def aids_step(
    tables: AidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    hands: FloatArray,
    flaps: FloatArray,
    acting: FloatArray,
    dt: float,
) -> None:
    """Turn the hands' stick and lever into the controls that act over the coming frame.

    A change of a switch captures the present attitude, height and speed; what then differs from the controls that acted
    last is kept as an offset that fades away, so no control steps.

    Args:
        state: Their state, updated in place.
        switches: Which are on, shape (SWITCH_COUNT,).
        hands: Stick and lever as the pilot holds them.
        flaps: Deflection in each interval between settings less that of the schedule at the aids' airspeed [rad].
        acting: In: stick and lever that acted last; out: those that act now.
    """
    if _changed(state, switches):
        aids_engage(tables, state, switches, x, nacelle, hands, flaps, acting)
    airspeed = x[STATE.u] * math.cos(x[STATE.pitch]) + x[STATE.w] * math.sin(x[STATE.pitch])
    state[MEMORY.schedule_airspeed] += dt / tables.schedule_time * (airspeed - state[MEMORY.schedule_airspeed])
    stick, lever, height_error, speed_error = _terms(tables, state, switches, x, nacelle, hands, flaps)
    stick += state[MEMORY.stick_offset]
    lever += state[MEMORY.lever_offset]
    acting[0] = limited(stick, 1.0)
    acting[1] = min(max(lever, 0.0), 1.0)
    fade = dt / tables.fade_time
    state[MEMORY.stick_offset] -= fade * state[MEMORY.stick_offset]
    state[MEMORY.lever_offset] -= fade * state[MEMORY.lever_offset]

    start, end = tables.blend
    helicopter = nacelle > 0.5 * (start + end)
    pushed = beyond(hands[0], tables.dead_zone)
    if not helicopter and switches[AIRSPEED_HOLD] == 0.0:
        state[MEMORY.hands_lever] = hands[1]  # the throttle of an airplane; where it stands is no wish to climb later
    moved = beyond(hands[1] - state[MEMORY.hands_lever], 2.0 * tables.dead_zone)
    if switches[AIRSPEED_HOLD] != 0.0:
        state[MEMORY.airspeed_reference] += dt * 1.5 * (pushed if helicopter else moved)
        free = abs(speed_error) < 5.0
        if free:
            gain = tables.airspeed_frequency / tables.integral_time
            state[MEMORY.airspeed_integral] = limited(state[MEMORY.airspeed_integral] + dt * gain * speed_error, 1.5)
    if switches[ALTITUDE_HOLD] != 0.0:
        state[MEMORY.altitude_reference] += dt * 5.0 * (moved if helicopter else -pushed)
        if abs(height_error) < 20.0:
            gain = tables.altitude_frequency**2 / tables.integral_time
            state[MEMORY.altitude_integral] = limited(state[MEMORY.altitude_integral] + dt * gain * height_error, 4.0)
        # The attitude that keeps the height changes with speed, flaps and nacelles.
        state[MEMORY.pitch_reference] += dt / PATH_TIME * (1.0 - _share(tables, nacelle)) * _path_error(state, x)
    held_by_hold = (switches[AIRSPEED_HOLD] != 0.0 and helicopter) or (
        switches[ALTITUDE_HOLD] != 0.0 and not helicopter
    )
    if not held_by_hold:
        state[MEMORY.pitch_reference] -= dt * tables.rate_command * pushed
    # The reference never runs away from an attitude the aircraft cannot follow.
    window = 8.0 * math.pi / 180.0
    state[MEMORY.pitch_reference] = x[STATE.pitch] + limited(state[MEMORY.pitch_reference] - x[STATE.pitch], window)
