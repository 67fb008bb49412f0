"""Compiled limits out of the plane of symmetry: bank, and with it the corridor of a turn, and sideslip.

Legend: phi bank; p, r roll and yaw rate; v sideward airspeed along body y; rows of the model are its derivatives with
v, p, r, lateral stick, pedals.
"""

from __future__ import annotations

import math

from rtsim.arrays import FloatArray
from rtsim.command import SENSOR
from rtsim.kernels.compiled import inner_kernel
from rtsim.protection import prediction_kernels as model
from rtsim.protection.law_data import (
    FREE,
    LAW,
    REASON_BANK,
    REASON_HIGH,
    REASON_LOW,
    REASON_SIDESLIP,
    REASON_TORQUE,
    ProtectionTables,
    SidewaysLimits,
)
from rtsim.protection.limiter_kernels import torque_limit
from rtsim.protection.prediction_kernels import speed_range
from rtsim.units import GRAVITY

_RIGHT_ANGLE = 0.5 * math.pi
_DRIFTS_BELOW, _DRIFTS_NOT_FROM = 20.0, 30.0
"""Airspeeds between which bank ceases to be what stops a sideward drift [m/s]: the fin does then."""
_PEDAL_FROM = 12.0
"""Airspeed from which the pedals move sideslip [m/s]: below, they turn the aircraft where it drifts anyway."""


@inner_kernel
def bank_limit(limits: SidewaysLimits, angle: float) -> float:
    """Largest bank [rad].

    Args:
        limits: Of the aircraft.
        angle: Nacelle angle [rad].
    """
    share = (angle - limits.bank_nacelle) / (_RIGHT_ANGLE - limits.bank_nacelle)
    if not (share > 0.0 and math.isfinite(limits.bank)):
        return limits.bank
    return limits.bank + min(share, 1.0) * (limits.bank_helicopter - limits.bank)


@inner_kernel
def sideward_limit(limits: SidewaysLimits, airspeed: float) -> float:
    """Largest sideward airspeed along body y [m/s].

    Args:
        limits: Of the aircraft.
        airspeed: Airspeed ahead [m/s].
    """
    share = (abs(airspeed) - limits.slow_below) / (limits.fast_above - limits.slow_below)
    if not (share > 0.0 and math.isfinite(limits.slow)):
        return limits.slow
    return limits.slow + min(share, 1.0) * (limits.fast - limits.slow)


@inner_kernel
def slip_speed(slip: float, airspeed: float, climb: float, alpha_speed: float) -> float:
    """Sideward airspeed along body y that a sideslip stands for [m/s].

    Args:
        slip: Sideslip [rad].
        airspeed: Airspeed ahead [m/s].
        climb: Climb rate [m/s].
        alpha_speed: Added to the airspeed where sideslip is an angle [m/s].
    """
    if slip == 0.0:
        return 0.0
    return float(math.tan(slip) * math.sqrt(airspeed * airspeed + climb * climb + alpha_speed * alpha_speed))


@inner_kernel
def sideward_speed(sensors: FloatArray, alpha_speed: float) -> float:
    """The same of what is known [m/s].

    Args:
        sensors: Order of ``rtsim.command.Sensors``.
        alpha_speed: As for ``slip_speed``.
    """
    return slip_speed(sensors[SENSOR.sideslip], sensors[SENSOR.airspeed], sensors[SENSOR.climb_rate], alpha_speed)


@inner_kernel
def worst_flapping(sensors: FloatArray) -> float:
    """Flapping of the rotor that flaps more [rad]; that of both where the sides are not told apart."""
    sides = max(sensors[SENSOR.flapping_left], sensors[SENSOR.flapping_right])
    return float(max(abs(sensors[SENSOR.flapping]), sides))


@inner_kernel
def worst_torque(sensors: FloatArray) -> float:
    """Torque of the mast that carries more [N m]; that of both where the sides are not told apart."""
    sides = max(sensors[SENSOR.mast_torque_left], sensors[SENSOR.mast_torque_right])
    return float(max(sensors[SENSOR.mast_torque], sides))


@inner_kernel
def moves_out_of_symmetry(sensors: FloatArray, command: FloatArray) -> bool:
    """Whether there is anything for these limits to look at.

    Args:
        command: Stick, lever, nacelle rate, lateral stick, pedals.
    """
    still = sensors[SENSOR.bank] == 0.0 and sensors[SENSOR.roll_rate] == 0.0 and sensors[SENSOR.yaw_rate] == 0.0
    return not (still and sensors[SENSOR.sideslip] == 0.0 and command[3] == 0.0 and command[4] == 0.0)


@inner_kernel
def _row(cell: FloatArray, place: int, v: float, p: float, r: float) -> float:
    return float(cell[place] * v + cell[place + 1] * p + cell[place + 2] * r)


@inner_kernel
def turn_allowed(tables: ProtectionTables, sensors: FloatArray) -> tuple[float, float]:
    """Largest bank that limit and corridor leave, and the reason it is no larger.

    The corridor's part is the load factor whose sides are just ``turn_margin`` away from the airspeed to come.
    """
    settings, corridor = tables.settings, tables.corridor
    airspeed, angle = sensors[SENSOR.airspeed], sensors[SENSOR.nacelle_angle]
    allowed, reason = bank_limit(tables.sideways, angle) - settings.bank_buffer, REASON_BANK
    ahead = settings.turn_time * sensors[SENSOR.airspeed_rate]
    low, high = speed_range(corridor, angle, 0.0)
    low_one, high_one = speed_range(corridor, angle, 1.0)
    excess = (airspeed + min(ahead, 0.0) - low - settings.turn_margin) / max(low_one - low, 1e-3)
    side = REASON_LOW
    spare = (high - airspeed - max(ahead, 0.0) - settings.turn_margin) / max(high - high_one, 1e-3)
    if spare < excess:
        excess, side = spare, REASON_HIGH
    turn = max(math.acos(1.0 / (1.0 + max(excess, 0.0))), settings.bank_least)
    if turn < allowed:
        return turn, side
    return allowed, reason


@inner_kernel
def _hold_lever(tables: ProtectionTables, state: FloatArray) -> None:
    """Where one side does not answer, keep the lever near where both last did.

    There the torque's bound may take it to the lower end of what is left, no further: the mast of the side that does
    not answer would have it down to its stop, and the aircraft over.
    """
    settings, missed = tables.settings, abs(state[LAW.roll_bias])
    if missed < settings.even_roll or state[LAW.started] == 0.0:
        state[LAW.even_lever] = state[LAW.acted_lever]
    elif missed > settings.uneven_roll:
        least = max(state[LAW.even_lever] - settings.uneven_lever, 0.0)
        most = min(state[LAW.even_lever] + settings.uneven_lever, 1.0)
        if not least < state[LAW.lever_high] < most:
            state[LAW.lever_reason] = REASON_BANK
        state[LAW.lever_low], state[LAW.lever_high] = least, min(max(state[LAW.lever_high], least), most)


@inner_kernel
def _bound_twist(tables: ProtectionTables, state: FloatArray, cell: FloatArray, sensors: FloatArray) -> None:
    """Narrow the lateral stick's bounds so that neither mast passes its torque, as far as the bank's leave room."""
    settings = tables.settings
    followed = settings.period / settings.differential_lag
    state[LAW.differential_collective] += min(followed, 1.0) * (
        state[LAW.acted_lateral] - state[LAW.differential_collective]
    )
    twist = cell[model.CELL.twist + 3]
    if abs(twist) < 1e3:
        return
    limit = torque_limit(tables.torque, sensors[SENSOR.airspeed], sensors[SENSOR.nacelle_angle])
    # Where both are near the limit the lever is what counts: a little twist stays free, else nothing would roll.
    most = max(settings.torque_share * limit, sensors[SENSOR.mast_torque] + settings.twist_share * limit)
    right, left = (most - sensors[SENSOR.mast_torque_right]) / twist, (most - sensors[SENSOR.mast_torque_left]) / twist
    here, low, high = state[LAW.differential_collective], state[LAW.lateral_low], state[LAW.lateral_high]
    first, last = (here + right, here - left) if twist < 0.0 else (here - left, here + right)
    if first > low:
        state[LAW.lateral_low], state[LAW.lateral_low_reason] = min(first, high), REASON_TORQUE
    if last < high:
        state[LAW.lateral_high], state[LAW.lateral_high_reason] = max(last, low), REASON_TORQUE


@inner_kernel
def _learn(
    tables: ProtectionTables, state: FloatArray, cell: FloatArray, sensors: FloatArray, v: float
) -> tuple[float, float]:
    """Rolling and yawing acceleration without their own controls, with what the model misses now.

    It misses a gust, or a surface that has run away; what it missed is low-passed.
    """
    settings = tables.settings
    p, r = sensors[SENSOR.roll_rate], sensors[SENSOR.yaw_rate]
    lateral, pedal = state[LAW.acted_lateral], state[LAW.acted_pedal]
    roll, yaw = model.CELL.roll, model.CELL.yaw
    rolled = _row(cell, roll, v, p, r) + cell[roll + 4] * pedal
    yawed = _row(cell, yaw, v, p, r) + cell[yaw + 3] * lateral
    share = settings.period / settings.roll_filter if state[LAW.started] != 0.0 else 0.0
    missed = (p - state[LAW.last_roll_rate]) / settings.period - rolled - cell[roll + 3] * lateral
    state[LAW.roll_bias] += share * (missed - state[LAW.roll_bias])
    missed = (r - state[LAW.last_yaw_rate]) / settings.period - yawed - cell[yaw + 4] * pedal
    state[LAW.yaw_bias] += share * (missed - state[LAW.yaw_bias])
    return rolled + state[LAW.roll_bias], yawed + state[LAW.yaw_bias]


@inner_kernel
def _drift_allowed(tables: ProtectionTables, sensors: FloatArray, limit: float, v: float, pushed: float) -> float:
    """Largest sine of the bank to the right that lets a sideward drift come to its limit in time; above 1: any."""
    settings = tables.settings
    fades = (abs(sensors[SENSOR.airspeed]) - _DRIFTS_BELOW) / (_DRIFTS_NOT_FROM - _DRIFTS_BELOW)
    if fades >= 1.0:
        return 2.0
    free = max(fades, 0.0) * 4.0
    return float(((limit - v) / settings.drift_time - pushed) / (GRAVITY * math.cos(sensors[SENSOR.pitch])) + free)


@inner_kernel
def _bound_bank(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    sensors: FloatArray,
    drift: tuple[float, float, float],
    rolled: float,
) -> None:
    """Bound the lateral stick so that bank stays inside; in slow flight so that a drift does, too.

    Args:
        drift: Limit of the sideward airspeed, the airspeed [m/s], and its acceleration but for the bank's [m/s^2].
        rolled: Rolling acceleration without the stick [rad/s^2].
    """
    limit, v, pushed = drift
    allowed, reason = turn_allowed(tables, sensors)
    right, left, right_reason, left_reason = allowed, allowed, reason, reason
    to_right = _drift_allowed(tables, sensors, limit, v, pushed)
    to_left = _drift_allowed(tables, sensors, limit, -v, -pushed)
    if to_right < math.sin(right):
        right, right_reason = math.asin(max(to_right, -math.sin(allowed))), REASON_SIDESLIP
    if to_left < math.sin(left):
        left, left_reason = math.asin(max(to_left, -math.sin(allowed))), REASON_SIDESLIP
    power = cell[model.CELL.roll + 3]
    if power <= 0.1:
        return
    f, bank, rolling = tables.settings.bank_frequency, sensors[SENSOR.bank], _bank_rate(sensors)
    up, down = f * f * (right - bank) - 2.0 * f * rolling, -f * f * (left + bank) - 2.0 * f * rolling
    state[LAW.lateral_low] = max(min((down - rolled) / power, 1.0), -1.0)
    state[LAW.lateral_high] = max(min((up - rolled) / power, 1.0), -1.0)
    state[LAW.lateral_low_reason], state[LAW.lateral_high_reason] = left_reason, right_reason


@inner_kernel
def _bank_rate(sensors: FloatArray) -> float:
    """Rate of the bank angle [rad/s]."""
    bank, pitch = sensors[SENSOR.bank], sensors[SENSOR.pitch]
    turning = sensors[SENSOR.pitch_rate] * math.sin(bank) + sensors[SENSOR.yaw_rate] * math.cos(bank)
    return float(sensors[SENSOR.roll_rate] + math.sin(pitch) / max(math.cos(pitch), 0.1) * turning)


@inner_kernel
def _bound_sideslip(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    sensors: FloatArray,
    drift: tuple[float, float, float],
    yawed: float,
) -> None:
    """Bound the pedals so that sideslip stays inside: they turn the nose, and the turn moves the air to the other side.

    Args:
        drift: As for ``_bound_bank``.
        yawed: Yawing acceleration without the pedals [rad/s^2].
    """
    limit, v, pushed = drift
    side = model.CELL.side
    effect = cell[side + 2] * cell[model.CELL.yaw + 4]
    if sensors[SENSOR.airspeed] <= _PEDAL_FROM or effect >= -0.1 or not math.isfinite(limit):
        return
    f, bank, upright = tables.settings.sideslip_frequency, sensors[SENSOR.bank], math.cos(sensors[SENSOR.pitch])
    slipping = pushed + GRAVITY * upright * math.sin(bank)
    rest = cell[side] * slipping + cell[side + 2] * yawed + GRAVITY * upright * math.cos(bank) * _bank_rate(sensors)
    up, down = f * f * (limit - v) - 2.0 * f * slipping, -f * f * (limit + v) - 2.0 * f * slipping
    state[LAW.pedal_low] = max(min((up - rest) / effect, 1.0), -1.0)
    state[LAW.pedal_high] = max(min((down - rest) / effect, 1.0), -1.0)
    state[LAW.pedal_reason] = REASON_SIDESLIP


@inner_kernel
def limit_sideways(tables: ProtectionTables, state: FloatArray, cell: FloatArray, sensors: FloatArray) -> None:
    """Bound lateral stick, pedals, and the lever where one side does not answer.

    The stick so that bank and masts stay inside, the pedals so that sideslip does; bank and sideslip approach their
    bounds no faster than a critically damped second-order motion would.

    Args:
        state: Law state; the bounds are set.
        cell: The model here.
        sensors: What is known, order of ``rtsim.command.Sensors``.
    """
    side = model.CELL.side
    v = sideward_speed(sensors, tables.model.alpha_speed)
    rolled, yawed = _learn(tables, state, cell, sensors, v)
    pushed = _row(cell, side, v, sensors[SENSOR.roll_rate], sensors[SENSOR.yaw_rate])
    pushed += cell[side + 3] * state[LAW.acted_lateral] + cell[side + 4] * state[LAW.acted_pedal]
    limit = sideward_limit(tables.sideways, sensors[SENSOR.airspeed]) - tables.settings.sideslip_buffer
    drift = (limit, v, pushed)
    _hold_lever(tables, state)
    _bound_bank(tables, state, cell, sensors, drift, rolled)
    _bound_twist(tables, state, cell, sensors)
    _bound_sideslip(tables, state, cell, sensors, drift, yawed)


@inner_kernel
def free_sideways(state: FloatArray) -> None:
    """Let lateral stick and pedals pass.

    Args:
        state: Law state, updated in place.
    """
    state[LAW.lateral_low], state[LAW.lateral_high] = -FREE, FREE
    state[LAW.pedal_low], state[LAW.pedal_high] = -FREE, FREE
