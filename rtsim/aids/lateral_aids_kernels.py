"""Compiled pilot aids out of the plane of symmetry: damping, bank, heading, coordinated turns, the place in hover.

Right is positive. A gain is an acceleration wanted over the acceleration that the control gives.

Legend:
    state: Memory of the aids, ``MEMORY``.
    switches: Which are on.
    airspeed: Airspeed that schedules the aids [m/s].
    hands: The command of the hands, in the order of its channels, within the travel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rtsim.aids.aids_kernels import (
    BANK_RETENTION,
    HEADING_HOLD,
    MEMORY,
    POSITION_HOLD,
    ROLL_DAMPING,
    TURN_COORDINATION,
    YAW_DAMPING,
    beyond,
    limited,
    scheduled,
)
from rtsim.aircraft.variables import STATE
from rtsim.arrays import FloatArray
from rtsim.command import CHANNELS
from rtsim.kernels.compiled import inner_kernel
from rtsim.places import Places
from rtsim.units import DEGREE, GRAVITY

CHANNEL = Places(*CHANNELS)
LATERAL_MAP = Places(
    "roll_sensitivity", "roll_damping", "yaw_sensitivity", "yaw_damping", "weathercock", "pitch"
)  # fmt: skip
"""Layers of ``LateralAidTables.maps``."""
LEVEL_BANK = 3.0 * DEGREE
"""A smaller bank that forward flight is left in becomes level [rad]."""
STEADY_YAW_RATE = 2.0 * DEGREE
"""The heading is held from a smaller yaw rate on [rad/s]."""
QUIET_TIME = 0.5
"""The place is held when the hands have left it alone for so long [s]."""
STILL_HELD = 1.3
"""A place that is held is let go at this multiple of the ground speed up to which it is taken."""


class LateralAidTables(NamedTuple):
    """Schedules and targets of the lateral aids. SI and radians."""

    airspeed: FloatArray
    """Airspeed axis [m/s]."""
    nacelle: FloatArray
    """Nacelle axis [rad]."""
    maps: FloatArray
    """Roll acceleration per lateral stick and roll rate, yaw acceleration per pedal, yaw rate and lateral velocity,
    trim pitch; (LATERAL_MAP.size, V, N)."""
    roll_damping: float
    """Roll damping the roll damper aims at [1/s]."""
    yaw_damping: float
    """Yaw damping the yaw damper aims at [1/s]."""
    bank_frequency: float
    """Natural frequency of bank retention [rad/s]."""
    bank_damping: float
    """Damping ratio of bank retention."""
    roll_rate_command: float
    """Roll rate commanded by full stick while the bank is retained [rad/s]."""
    largest_bank: float
    """Largest bank that the stick asks for while the bank is retained [rad]."""
    heading_frequency: float
    """Natural frequency of heading hold by pedals [rad/s]."""
    heading_time: float
    """Time constant of its integral [s]."""
    turn_to_heading: float
    """Turn rate asked for per heading error where the heading is held by bank [1/s]."""
    heading_bank: float
    """Largest bank of heading hold [rad]."""
    sideslip_frequency: float
    """Weathercock frequency that turn coordination aims at [rad/s]."""
    turning: tuple[float, float]
    """Airspeeds between which bank comes to mean a turn [m/s]."""
    pedals: tuple[float, float]
    """Airspeeds between which heading hold passes from pedals to bank [m/s]."""
    place_speed: float
    """Ground speed up to which a place is taken, and largest one asked for towards it [m/s]."""
    place_rate: float
    """Speed asked for per distance from the place [1/s]."""
    place_damping: float
    """Acceleration asked for per speed error [1/s]."""
    place_time: float
    """Time constant of the integral [s]."""
    place_attitude: float
    """Largest bank, and pitch from its trim, that the place asks for [rad]."""
    authority: float
    """Largest part of lateral stick or pedals that the aids may add."""
    dead_zone: float
    """Deflections below this leave the references alone."""
    fade_time: float
    """Time in which what a switched aid added fades [s]."""


@inner_kernel
def _risen(between: tuple[float, float], value: float) -> float:
    """0 below the first, 1 above the second, smooth between."""
    share = min(max((value - between[0]) / (between[1] - between[0]), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@inner_kernel
def _switched(state: FloatArray, switches: FloatArray) -> tuple[bool, bool]:
    """Whether a lateral aid is on, and whether one was switched since the last frame or begins."""
    on = changed = False
    for i in range(ROLL_DAMPING, POSITION_HOLD + 1):
        on = on or switches[i] != 0.0
        changed = changed or switches[i] != max(state[MEMORY.last_switches + i], 0.0)
    return on, changed


@inner_kernel
def _begin(state: FloatArray, x: FloatArray) -> None:
    """Take bank and heading as they are; the place is taken when the hands have left it alone for a while."""
    state[MEMORY.bank_reference] = x[STATE.bank]
    state[MEMORY.heading_reference] = x[STATE.heading]
    state[MEMORY.heading_integral] = 0.0
    state[MEMORY.heading_held] = 0.0
    state[MEMORY.north_integral] = 0.0
    state[MEMORY.east_integral] = 0.0
    state[MEMORY.last_north] = x[STATE.north]
    state[MEMORY.last_east] = x[STATE.east]
    state[MEMORY.quiet_time] = 0.0
    state[MEMORY.place_share] = 0.0


@inner_kernel
def _hold_place(
    tables: LateralAidTables,
    state: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    hands: FloatArray,
    dt: float,
) -> None:
    """Take or let go the place, and find the bank and pitch that go there and stay."""
    rate, damping = tables.place_rate, tables.place_damping
    north, east = x[STATE.north], x[STATE.east]
    v_north, v_east = (north - state[MEMORY.last_north]) / dt, (east - state[MEMORY.last_east]) / dt
    state[MEMORY.last_north], state[MEMORY.last_east] = north, east
    share = state[MEMORY.place_share]
    limit = tables.place_speed * (STILL_HELD if share > 0.0 else 1.0)
    centred = max(abs(hands[CHANNEL.stick]), abs(hands[CHANNEL.lateral_stick])) <= tables.dead_zone
    if not centred or v_north * v_north + v_east * v_east > limit * limit:
        # Bank and pitch go on from what the place asked for.
        state[MEMORY.bank_reference] += share * (state[MEMORY.place_bank] - state[MEMORY.bank_reference])
        state[MEMORY.pitch_reference] += share * (state[MEMORY.place_pitch] - state[MEMORY.pitch_reference])
        state[MEMORY.place_share] = state[MEMORY.quiet_time] = 0.0
        return
    state[MEMORY.quiet_time] += dt
    if state[MEMORY.quiet_time] < QUIET_TIME:
        return
    if share == 0.0:  # where the aircraft comes to rest when it slows down at that rate
        state[MEMORY.north_reference] = north + v_north / rate
        state[MEMORY.east_reference] = east + v_east / rate
    state[MEMORY.place_share] = min(share + dt / tables.fade_time, 1.0)
    off_north, off_east = state[MEMORY.north_reference] - north, state[MEMORY.east_reference] - east
    error_north = limited(rate * off_north, tables.place_speed) - v_north
    error_east = limited(rate * off_east, tables.place_speed) - v_east
    largest, learning = tables.place_attitude * GRAVITY, dt * damping / tables.place_time
    a_north = damping * error_north + state[MEMORY.north_integral]
    a_east = damping * error_east + state[MEMORY.east_integral]
    # Of the speed error, not of the distance: it does not wind up while the aircraft comes to rest.
    state[MEMORY.north_integral] = limited(state[MEMORY.north_integral] + learning * error_north, largest)
    state[MEMORY.east_integral] = limited(state[MEMORY.east_integral] + learning * error_east, largest)
    sh, ch = math.sin(x[STATE.heading]), math.cos(x[STATE.heading])
    ahead, right = a_north * ch + a_east * sh, a_east * ch - a_north * sh
    trim = scheduled(tables, LATERAL_MAP.pitch, airspeed, nacelle)
    state[MEMORY.place_bank] = limited(right, largest) / GRAVITY
    state[MEMORY.place_pitch] = trim - limited(ahead, largest) / GRAVITY


@inner_kernel
def _heading_terms(
    tables: LateralAidTables, state: FloatArray, x: FloatArray, nacelle: float, airspeed: float
) -> tuple[float, float]:
    """Pedal, integral excepted, and bank that the heading error asks for."""
    error = (state[MEMORY.heading_reference] - x[STATE.heading]) * state[MEMORY.heading_held]
    by_bank = _risen(tables.pedals, airspeed)
    sensitivity = max(scheduled(tables, LATERAL_MAP.yaw_sensitivity, airspeed, nacelle), 0.05)
    pedal = (1.0 - by_bank) * tables.heading_frequency**2 * error / sensitivity
    bank = limited(max(airspeed, 0.0) / GRAVITY * tables.turn_to_heading * error, tables.heading_bank)
    return pedal, by_bank * bank


@inner_kernel
def _hold_heading(
    tables: LateralAidTables, state: FloatArray, x: FloatArray, nacelle: float, airspeed: float, hands: FloatArray
) -> None:
    """Take or let go the heading: it is the hands' while pedals move and, in forward flight, stick or bank turn."""
    turning = _risen(tables.turning, airspeed)
    turned = abs(hands[CHANNEL.lateral_stick]) > tables.dead_zone or abs(state[MEMORY.bank_reference]) > LEVEL_BANK
    if abs(hands[CHANNEL.pedal]) > tables.dead_zone or (turning > 0.0 and turned):
        pedal, bank = _heading_terms(tables, state, x, nacelle, airspeed)
        state[MEMORY.pedal_offset] += limited(pedal, tables.authority)
        state[MEMORY.bank_reference] += bank
        state[MEMORY.heading_held] = 0.0
    elif state[MEMORY.heading_held] == 0.0:
        state[MEMORY.heading_reference] = x[STATE.heading]
        if abs(x[STATE.r]) < STEADY_YAW_RATE and (turning == 0.0 or abs(x[STATE.bank]) < LEVEL_BANK):
            state[MEMORY.heading_held] = 1.0


@inner_kernel
def _retains_bank(switches: FloatArray) -> bool:
    """Whether the stick commands a roll rate and the bank stays: the holds need it as well."""
    return switches[BANK_RETENTION] != 0.0 or switches[HEADING_HOLD] != 0.0 or switches[POSITION_HOLD] != 0.0


@inner_kernel
def _stick(
    tables: LateralAidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    given: float,
) -> float:
    """Lateral stick with the aids as switched."""
    sensitivity = max(scheduled(tables, LATERAL_MAP.roll_sensitivity, airspeed, nacelle), 0.2)
    natural = min(scheduled(tables, LATERAL_MAP.roll_damping, airspeed, nacelle), 0.0)
    if _retains_bank(switches):
        wanted, w = state[MEMORY.bank_reference], tables.bank_frequency
        if switches[HEADING_HOLD] != 0.0:
            wanted += _heading_terms(tables, state, x, nacelle, airspeed)[1]
        if switches[POSITION_HOLD] != 0.0:
            wanted += state[MEMORY.place_share] * (state[MEMORY.place_bank] - wanted)
        damping = max(2.0 * tables.bank_damping * w + natural, 0.0)
        rate_wanted = tables.roll_rate_command * beyond(given, tables.dead_zone)
        added = w * w * (wanted - x[STATE.bank]) + damping * (rate_wanted - x[STATE.p])
        # The hands command the rate through the reference; their direct part would act twice.
        return limited(added / sensitivity, tables.authority)
    if switches[ROLL_DAMPING] != 0.0:
        given -= limited(max(tables.roll_damping + natural, 0.0) * x[STATE.p] / sensitivity, tables.authority)
    return given


@inner_kernel
def _pedal(
    tables: LateralAidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    given: float,
) -> float:
    """Pedals with the aids as switched."""
    sensitivity = max(scheduled(tables, LATERAL_MAP.yaw_sensitivity, airspeed, nacelle), 0.05)
    natural = min(scheduled(tables, LATERAL_MAP.yaw_damping, airspeed, nacelle), 0.0)
    turning = _risen(tables.turning, airspeed)
    forward = max(airspeed, 10.0)
    # The yaw rate of the turn that belongs to the bank is none to be damped.
    turn = turning * GRAVITY * math.sin(x[STATE.bank]) * math.cos(x[STATE.pitch]) / forward
    damped = 0.0
    if switches[YAW_DAMPING] != 0.0 or switches[HEADING_HOLD] != 0.0:
        damped = 1.0
    elif switches[TURN_COORDINATION] != 0.0:
        damped = turning
    added = damped * max(tables.yaw_damping + natural, 0.0) * (turn - x[STATE.r])
    if switches[TURN_COORDINATION] != 0.0:
        weathercock = scheduled(tables, LATERAL_MAP.weathercock, airspeed, nacelle)
        lacking = max(tables.sideslip_frequency**2 / forward - weathercock, 0.0)
        added += turning * lacking * x[STATE.v] - natural * turn
    added /= sensitivity
    if switches[HEADING_HOLD] != 0.0:
        added += _heading_terms(tables, state, x, nacelle, airspeed)[0] + state[MEMORY.heading_integral]
    return given + limited(added, tables.authority)


@inner_kernel
def _move_references(
    tables: LateralAidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    hands: FloatArray,
    dt: float,
) -> None:
    """Let the stick move the bank that is retained, and the heading's integral learn."""
    pushed = beyond(hands[CHANNEL.lateral_stick], tables.dead_zone)
    bank = x[STATE.bank]
    if pushed != 0.0:
        reference = state[MEMORY.bank_reference] + dt * tables.roll_rate_command * pushed
        # It never runs away from a bank that the aircraft cannot follow.
        reference = bank + limited(reference - bank, 15.0 * DEGREE)
        state[MEMORY.bank_reference] = limited(reference, tables.largest_bank)
    elif abs(state[MEMORY.bank_reference]) < LEVEL_BANK:
        state[MEMORY.bank_reference] -= dt * _risen(tables.turning, airspeed) * state[MEMORY.bank_reference]
    if switches[HEADING_HOLD] != 0.0:
        pedal, _ = _heading_terms(tables, state, x, nacelle, airspeed)
        integral = state[MEMORY.heading_integral] + dt / tables.heading_time * limited(pedal, 0.2)
        state[MEMORY.heading_integral] = limited(integral, tables.authority)


@inner_kernel
def lateral_aids_step(
    tables: LateralAidTables,
    state: FloatArray,
    switches: FloatArray,
    x: FloatArray,
    nacelle: float,
    airspeed: float,
    hands: FloatArray,
    acting: FloatArray,
    dt: float,
) -> None:
    """Turn the hands' lateral stick and pedals into those that act over the coming frame.

    Whoever takes over, and whatever is switched, what then differs from the controls that acted last is kept as an
    offset that fades away. Goes before ``aids_step``, which takes note of the switches.

    Args:
        nacelle: Place on the nacelle axis [rad].
        acting: In: the command that acted last; out: lateral stick and pedals that act now.
    """
    on, begins = _switched(state, switches)
    stick, pedal = hands[CHANNEL.lateral_stick], hands[CHANNEL.pedal]
    if on:
        if begins:
            _begin(state, x)
        if switches[POSITION_HOLD] != 0.0:
            _hold_place(tables, state, x, nacelle, airspeed, hands, dt)
        if switches[HEADING_HOLD] != 0.0:
            _hold_heading(tables, state, x, nacelle, airspeed, hands)
        stick = _stick(tables, state, switches, x, nacelle, airspeed, stick)
        pedal = _pedal(tables, state, switches, x, nacelle, airspeed, pedal)
    if begins or math.isnan(state[MEMORY.lateral_offset]):
        state[MEMORY.lateral_offset] = acting[CHANNEL.lateral_stick] - stick
    if begins or math.isnan(state[MEMORY.pedal_offset]):
        state[MEMORY.pedal_offset] = acting[CHANNEL.pedal] - pedal
    acting[CHANNEL.lateral_stick] = limited(stick + state[MEMORY.lateral_offset], 1.0)
    acting[CHANNEL.pedal] = limited(pedal + state[MEMORY.pedal_offset], 1.0)
    state[MEMORY.lateral_offset] -= dt / tables.fade_time * state[MEMORY.lateral_offset]
    state[MEMORY.pedal_offset] -= dt / tables.fade_time * state[MEMORY.pedal_offset]
    if on:
        _move_references(tables, state, switches, x, nacelle, airspeed, hands, dt)
