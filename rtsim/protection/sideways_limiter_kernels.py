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
def limit_sideways(tables: ProtectionTables, state: FloatArray, cell: FloatArray, sensors: FloatArray) -> None:
    """Bound the lateral stick so that bank stays inside, and the pedals so that sideslip does.

    Each approaches its bound no faster than a critically damped second-order motion would; in slow flight bank is held
    from where sideward flight would pass its limit, too.

    Args:
        state: Law state; the bounds of both are set.
        cell: The model here.
        sensors: What is known, order of ``rtsim.command.Sensors``.
    """
    settings = tables.settings
    bank, pitch, p, r = sensors[SENSOR.bank], sensors[SENSOR.pitch], sensors[SENSOR.roll_rate], sensors[SENSOR.yaw_rate]
    v = sideward_speed(sensors, tables.model.alpha_speed)
    lateral, pedal = state[LAW.acted_lateral], state[LAW.acted_pedal]
    roll, yaw, side = model.CELL.roll, model.CELL.yaw, model.CELL.side
    # What the model's rolling and yawing miss: another pilot's turn, a gust, a surface that has run away.
    share = settings.period / settings.roll_filter if state[LAW.started] != 0.0 else 0.0
    rolled = _row(cell, roll, v, p, r) + cell[roll + 4] * pedal
    yawed = _row(cell, yaw, v, p, r) + cell[yaw + 3] * lateral
    missed = (p - state[LAW.last_roll_rate]) / settings.period - rolled - cell[roll + 3] * lateral
    state[LAW.roll_bias] += share * (missed - state[LAW.roll_bias])
    missed = (r - state[LAW.last_yaw_rate]) / settings.period - yawed - cell[yaw + 4] * pedal
    state[LAW.yaw_bias] += share * (missed - state[LAW.yaw_bias])
    rolled += state[LAW.roll_bias]
    yawed += state[LAW.yaw_bias]

    _hold_lever(tables, state)

    allowed, reason = turn_allowed(tables, sensors)
    right, left, right_reason, left_reason = allowed, allowed, reason, reason
    sine, cosine = math.sin(pitch), math.cos(pitch)
    pushed = _row(cell, side, v, p, r) + cell[side + 3] * lateral + cell[side + 4] * pedal
    limit = sideward_limit(tables.sideways, sensors[SENSOR.airspeed]) - settings.sideslip_buffer
    fades = (abs(sensors[SENSOR.airspeed]) - _DRIFTS_BELOW) / (_DRIFTS_NOT_FROM - _DRIFTS_BELOW)
    if fades < 1.0 and math.isfinite(limit):
        free = max(fades, 0.0) * 4.0
        to_right = ((limit - v) / settings.drift_time - pushed) / (GRAVITY * cosine) + free
        to_left = ((limit + v) / settings.drift_time + pushed) / (GRAVITY * cosine) + free
        if to_right < math.sin(right):
            right, right_reason = math.asin(max(to_right, -math.sin(allowed))), REASON_SIDESLIP
        if to_left < math.sin(left):
            left, left_reason = math.asin(max(to_left, -math.sin(allowed))), REASON_SIDESLIP

    f = settings.bank_frequency
    rolling = p + sine / max(cosine, 0.1) * (sensors[SENSOR.pitch_rate] * math.sin(bank) + r * math.cos(bank))
    power = cell[roll + 3]
    if power > 0.1:
        up, down = f * f * (right - bank) - 2.0 * f * rolling, -f * f * (left + bank) - 2.0 * f * rolling
        low, high = (down - rolled) / power, (up - rolled) / power
        state[LAW.lateral_low], state[LAW.lateral_high] = max(min(low, 1.0), -1.0), max(min(high, 1.0), -1.0)
        state[LAW.lateral_low_reason], state[LAW.lateral_high_reason] = left_reason, right_reason
        _bound_twist(tables, state, cell, sensors)

    u = sensors[SENSOR.airspeed]
    effect = cell[side + 2] * cell[yaw + 4]  # pedals turn the nose, and the turn moves the air to the other side
    if u > _PEDAL_FROM and effect < -0.1 and math.isfinite(limit):
        f = settings.sideslip_frequency
        slipping = pushed + GRAVITY * cosine * math.sin(bank)
        rest = cell[side] * slipping + cell[side + 2] * yawed + GRAVITY * cosine * math.cos(bank) * rolling
        up, down = f * f * (limit - v) - 2.0 * f * slipping, -f * f * (limit + v) - 2.0 * f * slipping
        low, high = (up - rest) / effect, (down - rest) / effect
        state[LAW.pedal_low], state[LAW.pedal_high] = max(min(low, 1.0), -1.0), max(min(high, 1.0), -1.0)
        state[LAW.pedal_reason] = REASON_SIDESLIP


@inner_kernel
def free_sideways(state: FloatArray) -> None:
    """Let lateral stick and pedals pass.

    Args:
        state: Law state, updated in place.
    """
    state[LAW.lateral_low], state[LAW.lateral_high] = -FREE, FREE
    state[LAW.pedal_low], state[LAW.pedal_high] = -FREE, FREE
