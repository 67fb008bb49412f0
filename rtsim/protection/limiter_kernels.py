"""Compiled parts of the laws: nacelle governor, recovery blend, and the limits of stick and lever.

Legend: z = (u, w, q, pitch) from the sensors; c = (stick, lever); lam blend, 0 pilot to 1 recovery.
"""

from __future__ import annotations

import math

from rtsim.arrays import FloatArray
from rtsim.kernels.compiled import inner_kernel
from rtsim.protection import prediction_kernels as model
from rtsim.protection.law_data import (
    FREE,
    LAW,
    REASON_FLAP,
    REASON_GATE,
    REASON_HIGH,
    REASON_LOAD,
    REASON_LOW,
    REASON_NONE,
    REASON_PITCH,
    REASON_SINK,
    REASON_TORQUE,
    ProtectionTables,
    SinkTables,
    TorqueTables,
)
from rtsim.protection.prediction_kernels import accelerations, affine, model_at, roll_out, speed_range, turn_model
from rtsim.units import GRAVITY

_LOADS_FROM = 10.0
"""Airspeed from which a pitch rate is reckoned as load [m/s]."""
_LEAST_SENSITIVITY = 1e3
"""Mast torque that all of the lever is taken to give at least [N m]."""


@inner_kernel
def torque_limit(tables: TorqueTables, airspeed: float, nacelle: float) -> float:
    """Mast-torque limit at a condition [N m]."""
    if nacelle > tables.takeoff_nacelle and airspeed < tables.takeoff_airspeed:
        return tables.takeoff
    return tables.cruise


@inner_kernel
def allowed_sink(tables: SinkTables, airspeed: float, altitude: float) -> float:
    """Sink rate a pilot may fly [m/s]."""
    above = max(0.0, altitude - tables.height) / tables.time
    return max(tables.floor, tables.slope * abs(airspeed)) + above


@inner_kernel
def clip(value: float, low: float, high: float) -> float:
    """Limit a value; the upper bound wins where bounds cross.

    Args:
        value: The value.
        low: Lower bound.
        high: Upper bound.
    """
    return min(max(value, low), high)


@inner_kernel
def govern(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[tuple[float, float], tuple[float, float]],
    nacelle: tuple[float, float, float],
    pilot_rate: float,
    out: FloatArray,
) -> None:
    """Bound the nacelle rate: turn back where even stopping leaves the corridor, else scale what the pilot asks for.

    Args:
        state: Law state; its nacelle bounds are set.
        cell: The model here.
        z: u, w, q, pitch.
        controls: Stick and lever that will act if the nacelles stop, and those that the pilot asks for.
        nacelle: Command angle, angle, rate [rad, rad, rad/s].
        pilot_rate: Nacelle rate asked for [rad/s].
        out: Scratch of ROLL_OUT_SIZE numbers.
    """
    settings = tables.settings
    bias = (state[LAW.bias], settings.bias_decay)
    time = (settings.step, settings.horizon)
    guard = (settings.pitch, settings.pitch_frequency)
    acting, asked = controls
    state[LAW.rate_low], state[LAW.rate_high] = -FREE, FREE
    state[LAW.kind] = 0.0
    roll_out(tables.model, tables.corridor, cell, z, acting, nacelle, (0.0, 0.0), bias, time, guard, out)
    stopped = min(out[model.OUT.low], out[model.OUT.high])
    state[LAW.margin] = stopped
    if stopped < settings.reverse_margin:
        low_side = out[model.OUT.low] < out[model.OUT.high]
        ends = min(out[model.OUT.low_end], out[model.OUT.high_end])
        _turn_back(tables, state, cell, z, acting, nacelle, (low_side, ends), out)
    elif pilot_rate != 0.0:
        if asked != acting:
            roll_out(tables.model, tables.corridor, cell, z, asked, nacelle, (0.0, 0.0), bias, time, guard, out)
            stopped = min(out[model.OUT.low], out[model.OUT.high])
        _scale_rate(tables, state, cell, z, asked, nacelle, (pilot_rate, stopped), out)


@inner_kernel
def _turn_back(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle: tuple[float, float, float],
    stopped: tuple[bool, float],
    out: FloatArray,
) -> None:
    """Bound the nacelle rate so that the nacelles turn away from the side that stopping would cross."""
    settings = tables.settings
    low_side, ends = stopped
    angle = nacelle[1]
    state[LAW.rate_reason] = REASON_LOW if low_side else REASON_HIGH
    if not low_side and settings.finish_nacelle < angle <= settings.flat_high_nacelle:
        state[LAW.rate_high] = 0.0
        return
    state[LAW.kind] = 1.0
    back = settings.reverse_rate if low_side else -settings.reverse_rate
    if not low_side and angle <= settings.finish_nacelle:
        state[LAW.rate_high] = back
        return
    bias = (state[LAW.bias], settings.bias_decay)
    time = (settings.step, settings.horizon)
    guard = (settings.pitch, settings.pitch_frequency)
    turning = (back, settings.horizon)
    roll_out(tables.model, tables.corridor, cell, z, controls, nacelle, turning, bias, time, guard, out)
    turned = min(out[model.OUT.low_end], out[model.OUT.high_end])
    # Aft is the way out on the low side and forward on the high side even where the nacelles' own pull or drag costs
    # margin at first: only a turn that is seen to suffice may be slower than the fastest.
    share = 1.0
    if turned > settings.reverse_margin and turned > ends:
        share = clip((settings.reverse_margin - ends) / (turned - ends), 0.25, 1.0)
    if low_side:
        state[LAW.rate_low] = share * back
    else:
        state[LAW.rate_high] = share * back


@inner_kernel
def _scale_rate(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle: tuple[float, float, float],
    asked: tuple[float, float],
    out: FloatArray,
) -> None:
    """Bound the nacelle rate to the part of what is asked for after which stopping still keeps the margin."""
    settings = tables.settings
    rate, stopped = asked
    bias = (state[LAW.bias], settings.bias_decay)
    time = (settings.step, settings.horizon)
    guard = (settings.pitch, settings.pitch_frequency)
    tried = (rate, settings.apply)
    roll_out(tables.model, tables.corridor, cell, z, controls, nacelle, tried, bias, time, guard, out)
    margin = min(out[model.OUT.low], out[model.OUT.high])
    low_side = out[model.OUT.low] < out[model.OUT.high]
    if margin >= settings.pass_margin or margin >= stopped:
        return
    share = 0.0
    if stopped > settings.pass_margin:
        # The margin falls about linearly with the rate; what the secant allows is tried once more.
        share = (stopped - settings.pass_margin) / (stopped - margin)
        tried = (share * rate, settings.apply)
        roll_out(tables.model, tables.corridor, cell, z, controls, nacelle, tried, bias, time, guard, out)
        if min(out[model.OUT.low], out[model.OUT.high]) < settings.pass_margin:
            share *= 0.5
    gated = nacelle[1] <= tables.corridor.downstop_nacelle and not low_side
    if gated:
        share = 0.0
    if rate < 0.0:
        state[LAW.rate_low] = share * rate
    else:
        state[LAW.rate_high] = share * rate
    state[LAW.rate_reason] = REASON_LOW if low_side else (REASON_GATE if gated else REASON_HIGH)


@inner_kernel
def _recover(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    target: FloatArray,
    z: tuple[float, float, float, float],
    flight: tuple[float, float, float],
) -> None:
    """Recovery stick and lever: the regulator about the trim of an airspeed well inside the corridor."""
    settings = tables.settings
    airspeed, angle, climb = flight
    low, high = speed_range(tables.corridor, angle, cell[model.CELL.excess])
    aim = airspeed
    if state[LAW.recover_side] < 0.0:
        aim = max(airspeed, low + settings.recovery_margin)
        state[LAW.blend_reason] = REASON_LOW
    elif state[LAW.recover_side] == 0.0:
        state[LAW.blend_reason] = REASON_SINK
    else:
        aim = min(airspeed, high - settings.recovery_margin)
        state[LAW.blend_reason] = REASON_HIGH
    step = clip(aim - airspeed, -settings.recovery_step, settings.recovery_step)
    allowed = max(settings.sink_floor, settings.sink_slope * abs(airspeed))
    excess = -climb - allowed
    if step > 0.0 and excess > 0.0:
        # Height is not traded for speed beyond the allowed descent.
        step *= max(0.0, 1.0 - excess / allowed)
        state[LAW.blend_reason] = REASON_SINK
    model_at(tables.model, airspeed + step, angle + state[LAW.shift], target)
    if cell[model.CELL.load] != 1.0:
        turn_model(target, cell[model.CELL.load], cell[model.CELL.excess])
    d0 = z[0] - target[model.CELL.state]
    d1 = z[1] - target[model.CELL.state + 1]
    d2 = z[2] - target[model.CELL.state + 2]
    d3 = z[3] - target[model.CELL.state + 3]
    g = model.CELL.gain
    stick = target[model.CELL.control] - (cell[g] * d0 + cell[g + 1] * d1 + cell[g + 2] * d2 + cell[g + 3] * d3)
    lever = target[model.CELL.control + 1] - (cell[g + 4] * d0 + cell[g + 5] * d1 + cell[g + 6] * d2 + cell[g + 7] * d3)
    state[LAW.stick] = clip(stick, -1.0, 1.0)
    # Nose down the regulator would close the lever, whose drag costs more speed than the pull-up has time to win back:
    # a sink and the low-speed side are left with the power of level flight at least, the high-speed side without power,
    # but not on windmilling rotors.
    least = target[model.CELL.control + 1]
    if state[LAW.recover_side] > 0.0:
        least -= target[model.CELL.torque] / max(target[model.CELL.torque + 5], _LEAST_SENSITIVITY)
    state[LAW.lever] = clip(lever, clip(least, 0.0, 1.0), 1.0)


@inner_kernel
def blend_recovery(
    tables: ProtectionTables,
    state: FloatArray,
    work: tuple[FloatArray, FloatArray, FloatArray],
    z: tuple[float, float, float, float],
    asked: tuple[float, float],
    nacelle: tuple[float, float, float],
    pilot_rate: float,
    flight: tuple[float, float, float],
    altitude: float,
) -> None:
    """Decide how much of stick and lever the recovery takes, and its controls.

    Args:
        state: Law state; blend and recovery controls are set.
        work: The model here, scratch of CELL_SIZE and of ROLL_OUT_SIZE numbers.
        z: u, w, q, pitch.
        asked: Stick and lever of the pilot.
        nacelle: Command angle, angle, rate [rad, rad, rad/s].
        pilot_rate: Nacelle rate asked for [rad/s].
        flight: Airspeed [m/s], nacelle angle [rad], climb rate [m/s].
    """
    cell, target, out = work
    settings = tables.settings
    dt = settings.period
    bias = (state[LAW.bias], settings.bias_decay)
    allowed = clip(pilot_rate, state[LAW.rate_low], state[LAW.rate_high])
    roll_out(
        tables.model, tables.corridor, cell, z, asked, nacelle, (allowed, settings.apply), bias,
        (settings.step, settings.horizon), (settings.pitch, settings.pitch_frequency), out,
    )  # fmt: skip
    low, high = out[model.OUT.low], out[model.OUT.high]
    margin = min(low, high)
    state[LAW.margin] = margin
    wanted = clip((settings.blend_begin - margin) / (settings.blend_begin - settings.blend_full), 0.0, 1.0)
    if wanted > 0.0:
        state[LAW.recover_side] = -1.0 if low < high else 1.0
    airspeed, _, climb = flight
    sink = allowed_sink(tables.sink, airspeed, altitude)
    sinking = clip((-climb - sink) / (0.3 * sink), 0.0, 1.0)
    if sinking > wanted:
        wanted = sinking
        if state[LAW.blend] == 0.0 or state[LAW.recover_side] == 0.0:
            state[LAW.recover_side] = 0.0
    height = (altitude - settings.height_floor) / (settings.height_full - settings.height_floor)
    wanted = min(wanted, clip(height, 0.0, 1.0))
    state[LAW.blend] += clip(wanted - state[LAW.blend], -settings.blend_fall * dt, settings.blend_rise * dt)
    if state[LAW.blend] > 0.0:
        _recover(tables, state, cell, target, z, flight)


@inner_kernel
def limit_stick(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle_rate: float,
    measured_flapping: float,
) -> None:
    """Bound the stick so that pitch attitude, load factor and, with priority, flapping stay inside.

    Args:
        state: Law state; the stick's bounds are set.
        cell: The model here.
        z: u, w, q, pitch.
        controls: Stick and lever acting now.
        nacelle_rate: Nacelle rate [rad/s].
        measured_flapping: Magnitude of the flapping [rad].
    """
    settings = tables.settings
    low, high = -FREE, FREE
    low_reason, high_reason = REASON_NONE, REASON_NONE
    power = cell[model.CELL.b + 6]
    if power < -0.2:
        _, _, at_rest, _, _ = accelerations(cell, z, (0.0, controls[1]), (0.0, nacelle_rate))
        f = settings.pitch_frequency
        up = f * f * (settings.pitch - z[3]) - 2.0 * f * z[2]
        down = -f * f * (settings.pitch + z[3]) - 2.0 * f * z[2]
        low_reason, high_reason = REASON_PITCH, REASON_PITCH
        # A pull or a push adds the pitch rate times the airspeed over g to the load of the turn.
        per_rate, f = max(abs(z[0]), _LOADS_FROM) / GRAVITY, settings.load_frequency
        load, most, least = cell[model.CELL.load], settings.load_factor_max, settings.load_factor_min
        pull, push = f * ((most - load) / per_rate - z[2]), f * ((least - load) / per_rate - z[2])
        if pull < up:
            up, low_reason = pull, REASON_LOAD
        if push > down:
            down, high_reason = push, REASON_LOAD
        low, high = (up - at_rest) / power, (down - at_rest) / power

    slope_c, slope_s = cell[model.CELL.flap_c + 4], cell[model.CELL.flap_s + 4]
    square = slope_c * slope_c + slope_s * slope_s
    now_c = affine(cell, model.CELL.flap_c, z, controls, nacelle_rate)
    now_s = affine(cell, model.CELL.flap_s, z, controls, nacelle_rate)
    missed = clip(measured_flapping - math.sqrt(now_c * now_c + now_s * now_s), -0.02, 0.05)
    state[LAW.flap_bias] += settings.period / settings.bias_filter * (missed - state[LAW.flap_bias])
    if square > 0.0025:  # 2.9 deg per half travel: less is no means to limit flapping
        reach = max(settings.flapping - max(state[LAW.flap_bias], 0.0), 0.05)
        b_c, b_s = now_c - slope_c * controls[0], now_s - slope_s * controls[0]
        middle = -(b_c * slope_c + b_s * slope_s) / square
        rest = reach * reach - (b_c * b_c + b_s * b_s) + square * middle * middle
        half = math.sqrt(rest / square) if rest > 0.0 else 0.0
        if middle - half > low:
            low, low_reason = middle - half, REASON_FLAP
        if middle + half < high:
            high, high_reason = middle + half, REASON_FLAP
        if low > high:
            low, high = middle - half, middle + half
            low_reason, high_reason = REASON_FLAP, REASON_FLAP
    state[LAW.stick_low], state[LAW.stick_high] = clip(low, -1.0, 1.0), clip(high, -1.0, 1.0)
    state[LAW.stick_low_reason], state[LAW.stick_high_reason] = low_reason, high_reason


@inner_kernel
def limit_lever(
    tables: ProtectionTables, state: FloatArray, cell: FloatArray, torque: float, airspeed: float, angle: float
) -> None:
    """Bound the lever so that the mast torque stays inside, by feedback of the measured torque.

    Args:
        state: Law state; the lever's upper bound is set.
        cell: The model here.
        torque: Measured mast torque [N m].
        angle: Nacelle angle [rad].
    """
    settings = tables.settings
    dt = settings.period
    sensitivity = max(cell[model.CELL.torque + 5], _LEAST_SENSITIVITY)
    moved = dt / settings.collective_lag * (state[LAW.acted_lever] - state[LAW.collective])
    own = sensitivity * moved / dt
    rate = (torque - state[LAW.last_torque]) / dt - own if state[LAW.started] != 0.0 else 0.0
    state[LAW.torque_rate] += 0.2 * (rate - state[LAW.torque_rate])
    state[LAW.collective] += moved
    room = settings.torque_share * torque_limit(tables.torque, airspeed, angle) - torque
    room -= settings.torque_lead * max(state[LAW.torque_rate], 0.0)
    state[LAW.lever_high] = clip(state[LAW.collective] + room / sensitivity, 0.0, 1.0)
    state[LAW.lever_reason] = REASON_TORQUE
