"""Compiled protection laws: what they allow is decided 50 times a second and applied in every frame.

``law_decide`` looks at the sensors, predicts and leaves bounds, a blend and its recovery controls in the state;
``law_apply`` limits a command with them. A command that needs no limit passes bit for bit. Equations are in
docs/protection.md.
"""

from __future__ import annotations

import math

from rtsim.arrays import FloatArray
from rtsim.command import SENSOR
from rtsim.corridor.corridor_kernels import turn_excess
from rtsim.kernels.compiled import inner_kernel
from rtsim.protection import prediction_kernels as model
from rtsim.protection.law_data import *  # noqa: F403  # one place to take a law's kernels and its constants from
from rtsim.protection.law_data import (
    CAUSES,
    CHANGE_LEVER,
    CHANGE_RATE,
    CHANGE_STICK,
    FREE,
    LAW,
    LAW_FULL,
    LAW_GOVERNOR,
    LAW_OFF,
    ProtectionTables,
)
from rtsim.protection.limiter_kernels import allowed_sink as allowed_sink  # noqa: PLC0414
from rtsim.protection.limiter_kernels import blend_recovery, clip, govern, limit_lever, limit_stick
from rtsim.protection.limiter_kernels import torque_limit as torque_limit  # noqa: PLC0414
from rtsim.protection.prediction_kernels import accelerations, model_at, roll_out, turn_model, turn_motion
from rtsim.protection.sideways_limiter_kernels import (
    free_sideways,
    limit_sideways,
    moves_out_of_symmetry,
    worst_flapping,
    worst_torque,
)


@inner_kernel
def law_release(state: FloatArray) -> None:
    """Let every command pass.

    Args:
        state: Law state, updated in place.
    """
    state[LAW.blend] = 0.0
    state[LAW.stick_low], state[LAW.stick_high] = -FREE, FREE
    state[LAW.lever_low], state[LAW.lever_high] = -FREE, FREE
    state[LAW.rate_low], state[LAW.rate_high] = -FREE, FREE
    free_sideways(state)


@inner_kernel
def law_start(tables: ProtectionTables, state: FloatArray) -> None:
    """Set the state to that before the first decision.

    Args:
        state: Law state, overwritten.
    """
    state[:] = 0.0
    state[LAW.time] = tables.settings.warning_horizon
    state[LAW.margin] = FREE
    law_release(state)


@inner_kernel
def law_release_unblended(state: FloatArray) -> None:
    """Take the bounds away and leave the blend to its own decay.

    Args:
        state: Law state, updated in place.
    """
    blend = state[LAW.blend]
    law_release(state)
    state[LAW.blend] = blend


@inner_kernel
def _finite(values: FloatArray) -> bool:
    finite = True
    for i in range(values.shape[0]):
        finite = finite and math.isfinite(values[i])
    return finite


@inner_kernel
def _look_ahead(
    tables: ProtectionTables, state: FloatArray, sensors: FloatArray, command: FloatArray, work: FloatArray
) -> tuple[bool, tuple[float, float, float, float], tuple[float, float], tuple[float, float, float]]:
    """Predict the flight with the controls as they are; ``work`` then holds the model and the roll-out.

    Returns:
        Whether there is anything to decide on; the state z; stick and lever asked; the nacelles.
    """
    settings = tables.settings
    if not (_finite(sensors) and _finite(command)):
        # A law that cannot see does not act.
        law_release(state)
        state[LAW.started] = 0.0
        state[LAW.time], state[LAW.side] = settings.warning_horizon, 0.0
        return False, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0)
    cell = work[: model.CELL.size]
    out = work[2 * model.CELL.size : 2 * model.CELL.size + model.OUT.size]
    dt = settings.period
    airspeed, angle, rate = sensors[SENSOR.airspeed], sensors[SENSOR.nacelle_angle], sensors[SENSOR.nacelle_rate]
    pitch, climb = sensors[SENSOR.pitch], sensors[SENSOR.climb_rate]
    sine, cosine = math.sin(pitch), math.cos(pitch)
    z = (airspeed * cosine + climb * sine, airspeed * sine - climb * cosine, sensors[SENSOR.pitch_rate], pitch)
    asked = (clip(command[0], -1.0, 1.0), clip(command[1], 0.0, 1.0))
    if state[LAW.started] == 0.0:
        state[LAW.acted_stick], state[LAW.acted_lever], state[LAW.acted_rate] = asked[0], asked[1], 0.0
        state[LAW.collective] = asked[1]
        state[LAW.acted_lateral], state[LAW.acted_pedal] = clip(command[3], -1.0, 1.0), clip(command[4], -1.0, 1.0)
        state[LAW.last_nacelle_rate] = rate
    acting = (state[LAW.acted_stick], state[LAW.acted_lever])
    model_at(tables.model, airspeed, angle + state[LAW.shift], cell)
    bank, rolling = sensors[SENSOR.bank], sensors[SENSOR.roll_rate]
    if tables.model.turns != 0 and (bank != 0.0 or rolling != 0.0):
        # A turn that is begun is watched as what it becomes, one that is ended as what it is.
        coming = max(abs(bank), abs(bank + settings.turn_lead * rolling))
        turn_model(cell, 1.0 + turn_excess(bank), turn_excess(coming))
        z = turn_motion(sensors)

    _, _, _, expected, _ = accelerations(cell, z, acting, (0.0, rate))
    missing = clip(sensors[SENSOR.airspeed_rate] - expected, -settings.bias_limit, settings.bias_limit)
    state[LAW.bias] += dt / settings.bias_filter * (missing - state[LAW.bias])
    bias = (state[LAW.bias], settings.bias_decay)
    # The filter's command angle follows from its motion: n'' = w^2 (c - n) - 2 w n'.
    w = tables.model.nacelle_frequency
    turning = (rate - state[LAW.last_nacelle_rate]) / dt
    state[LAW.last_nacelle_rate] = rate
    commanded = clip(angle + (2.0 * rate + turning / w) / w, tables.model.forward_stop, tables.model.aft_stop)
    nacelle = (commanded, angle, rate)
    if sensors[SENSOR.nacelle_ok] == 0.0:
        nacelle = (angle, angle, 0.0)

    horizon = settings.warning_horizon
    held = state[LAW.acted_rate] if sensors[SENSOR.nacelle_ok] != 0.0 else 0.0
    time, guard = (settings.warning_step, horizon), (settings.pitch, settings.pitch_frequency)
    roll_out(tables.model, tables.corridor, cell, z, acting, nacelle, (held, horizon), bias, time, guard, out)
    state[LAW.time], state[LAW.side] = out[model.OUT.time], out[model.OUT.side]
    state[LAW.margin] = min(out[model.OUT.low], out[model.OUT.high])
    law_release_unblended(state)
    return True, z, asked, nacelle


@inner_kernel
def _remember(state: FloatArray, sensors: FloatArray) -> None:
    state[LAW.last_torque] = worst_torque(sensors)
    state[LAW.last_roll_rate], state[LAW.last_yaw_rate] = sensors[SENSOR.roll_rate], sensors[SENSOR.yaw_rate]
    state[LAW.started] = 1.0


@inner_kernel
def law_watch(
    tables: ProtectionTables, state: FloatArray, sensors: FloatArray, command: FloatArray, work: FloatArray
) -> None:
    """Look ahead and limit nothing: what the law ``monitor`` does.

    Args:
        state: Law state, updated in place, shape (LAW_STATE_SIZE,).
        command: Stick, lever, nacelle rate [rad/s], lateral stick, pedals that would act without the law.
        work: Scratch of WORK_SIZE numbers.
    """
    seen, _, _, _ = _look_ahead(tables, state, sensors, command, work)
    if seen:
        _remember(state, sensors)


@inner_kernel
def law_decide(
    tables: ProtectionTables, state: FloatArray, sensors: FloatArray, command: FloatArray, work: FloatArray
) -> None:
    """Decide what is allowed until the next decision, by any of the laws.

    Args:
        state: Law state, updated in place, shape (LAW_STATE_SIZE,).
        command: Stick, lever, nacelle rate [rad/s], lateral stick, pedals that would act without the law.
        work: Scratch of WORK_SIZE numbers.
    """
    seen, z, asked, nacelle = _look_ahead(tables, state, sensors, command, work)
    if not seen:
        return
    cell, target = work[: model.CELL.size], work[model.CELL.size : 2 * model.CELL.size]
    out = work[2 * model.CELL.size : 2 * model.CELL.size + model.OUT.size]
    acting = (state[LAW.acted_stick], state[LAW.acted_lever])
    airspeed, angle, rate = sensors[SENSOR.airspeed], sensors[SENSOR.nacelle_angle], sensors[SENSOR.nacelle_rate]
    if tables.law == LAW_GOVERNOR:
        govern(tables, state, cell, z, (asked, asked), nacelle, command[2], out)
    elif tables.law == LAW_FULL:
        govern(tables, state, cell, z, (acting, asked), nacelle, command[2], out)
        flight = (airspeed, angle, sensors[SENSOR.climb_rate])
        scratch = (cell, target, out)
        blend_recovery(tables, state, scratch, z, asked, nacelle, command[2], flight, sensors[SENSOR.altitude])
        limit_stick(tables, state, cell, z, acting, rate, worst_flapping(sensors))
        limit_lever(tables, state, cell, worst_torque(sensors), airspeed, angle)
        if tables.model.turns != 0 and moves_out_of_symmetry(sensors, command):
            limit_sideways(tables, state, cell, sensors)
    _remember(state, sensors)


@inner_kernel
def law_apply(tables: ProtectionTables, state: FloatArray, command: FloatArray, applied: FloatArray) -> None:
    """Limit this frame's command by what was decided last.

    Args:
        state: Law state; what acted and why is noted in it.
        command: Stick, lever, nacelle rate [rad/s], lateral stick, pedals without the law.
        applied: Written: the same with the law; may be the same array.
    """
    stick, lever, rate, lateral, pedal = command[0], command[1], command[2], command[3], command[4]
    # A command that is no number is answered with what acted last.
    if not math.isfinite(stick):
        stick = state[LAW.acted_stick]
    if not math.isfinite(lever):
        lever = state[LAW.acted_lever]
    if not math.isfinite(rate):
        rate = 0.0
    if not math.isfinite(lateral):
        lateral = state[LAW.acted_lateral]
    if not math.isfinite(pedal):
        pedal = state[LAW.acted_pedal]
    applied[0], applied[1], applied[2], applied[3], applied[4] = stick, lever, rate, lateral, pedal
    for place in CAUSES:
        state[place] = 0.0
    if tables.law >= LAW_GOVERNOR and state[LAW.override] == 0.0:
        applied[2] = clip(rate, state[LAW.rate_low], state[LAW.rate_high])
        if abs(applied[2] - rate) > CHANGE_RATE:
            state[LAW.rate_cause] = state[LAW.rate_reason]
        if tables.law == LAW_FULL:
            _apply_hands(state, stick, lever, applied)
            _apply_sideways(state, lateral, pedal, applied)
    state[LAW.acted] = 1.0
    state[LAW.acted_stick] = clip(applied[0], -1.0, 1.0)
    state[LAW.acted_lever] = clip(applied[1], 0.0, 1.0)
    state[LAW.acted_rate] = applied[2]
    state[LAW.acted_lateral], state[LAW.acted_pedal] = clip(applied[3], -1.0, 1.0), clip(applied[4], -1.0, 1.0)


@inner_kernel
def _apply_sideways(state: FloatArray, lateral: float, pedal: float, applied: FloatArray) -> None:
    applied[3] = clip(lateral, state[LAW.lateral_low], state[LAW.lateral_high])
    if applied[3] > lateral + CHANGE_STICK:
        state[LAW.lateral_cause] = state[LAW.lateral_low_reason]
    elif applied[3] < lateral - CHANGE_STICK:
        state[LAW.lateral_cause] = state[LAW.lateral_high_reason]
    applied[4] = clip(pedal, state[LAW.pedal_low], state[LAW.pedal_high])
    if abs(applied[4] - pedal) > CHANGE_STICK:
        state[LAW.pedal_cause] = state[LAW.pedal_reason]


@inner_kernel
def _apply_hands(state: FloatArray, stick: float, lever: float, applied: FloatArray) -> None:
    blend = state[LAW.blend]
    if blend > 0.0:
        applied[0] = stick + blend * (state[LAW.stick] - stick)
        applied[1] = lever + blend * (state[LAW.lever] - lever)
        if abs(applied[0] - stick) > CHANGE_STICK:
            state[LAW.stick_cause] = state[LAW.blend_reason]
        if abs(applied[1] - lever) > CHANGE_LEVER:
            state[LAW.lever_cause] = state[LAW.blend_reason]
    before = applied[0]
    applied[0] = clip(before, state[LAW.stick_low], state[LAW.stick_high])
    if applied[0] > before + CHANGE_STICK:
        state[LAW.stick_cause] = state[LAW.stick_low_reason]
    elif applied[0] < before - CHANGE_STICK:
        state[LAW.stick_cause] = state[LAW.stick_high_reason]
    before = applied[1]
    applied[1] = clip(before, state[LAW.lever_low], state[LAW.lever_high])
    if abs(applied[1] - before) > CHANGE_LEVER:
        state[LAW.lever_cause] = state[LAW.lever_reason]


@inner_kernel
def law_due(tables: ProtectionTables, state: FloatArray, frame: int) -> bool:
    """Whether the law decides in this frame, and so reads the sensors.

    Args:
        frame: Number of the frame.
    """
    return tables.law != LAW_OFF and (frame % tables.every == 0 or state[LAW.started] == 0.0)


@inner_kernel
def protect(
    tables: ProtectionTables,
    state: FloatArray,
    frame: int,
    sensors: FloatArray,
    command: FloatArray,
    applied: FloatArray,
    work: FloatArray,
) -> None:
    """One frame of a compiled law.

    Args:
        state: Law state, updated in place.
        frame: Number of the frame; the law decides when it is a multiple of ``tables.every``.
        sensors: What the law may know; read only in frames in which it decides.
        command: Stick, lever, nacelle rate [rad/s], lateral stick, pedals without the law.
        applied: Written: the same with the law; may be the same array.
        work: Scratch of WORK_SIZE numbers.
    """
    if law_due(tables, state, frame):
        law_decide(tables, state, sensors, command, work)
    law_apply(tables, state, command, applied)
