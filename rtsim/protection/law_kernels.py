"""Compiled protection laws: what they allow is decided 50 times a second and applied in every frame.

``law_decide`` looks at the sensors, predicts and leaves bounds, a blend and its recovery controls in the state;
``law_apply`` limits a command with them. A command that needs no limit passes bit for bit. Equations: docs/protection.md.

Legend: z = (u, w, q, pitch) from the sensors; c commanded, n actual nacelle angle; lam blend, 0 pilot to 1 recovery.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from rtsim.frame import FloatArray
from rtsim.protection import prediction_kernels as model
from rtsim.protection.prediction_kernels import (
    BoundaryTables,
    ModelTables,
    accelerations,
    affine,
    model_at,
    roll_out,
    speed_range,
)

LAW_OFF, LAW_MONITOR, LAW_GOVERNOR, LAW_FULL = 0, 1, 2, 3

# Places in the sensor array, the order of rtsim.command.Sensors. SI and radians, booleans as 0 and 1.
SENSE_TIME, SENSE_AIRSPEED, SENSE_AIRSPEED_RATE, SENSE_NACELLE, SENSE_NACELLE_RATE = 0, 1, 2, 3, 4
SENSE_PITCH, SENSE_PITCH_RATE, SENSE_FLIGHT_PATH, SENSE_ALTITUDE, SENSE_CLIMB_RATE = 5, 6, 7, 8, 9
SENSE_LOAD_FACTOR, SENSE_TORQUE, SENSE_FLAPPING, SENSE_DOWNSTOP, SENSE_NACELLE_OK = 10, 11, 12, 13, 14
SENSOR_COUNT = 15

# Reasons, as recorded: 0 none, else one more than the number of the limit in rtsim.protection.limits.LIMIT_KINDS.
REASON_NONE, REASON_LOW, REASON_HIGH, REASON_GATE = 0, 1, 2, 3
REASON_FLAP, REASON_TORQUE, REASON_PITCH, REASON_SINK = 6, 7, 9, 11

# Places in the law's state: what is allowed now ...
L_BLEND, L_STICK, L_LEVER = 0, 1, 2
L_STICK_LOW, L_STICK_HIGH, L_LEVER_LOW, L_LEVER_HIGH, L_RATE_LOW, L_RATE_HIGH = 3, 4, 5, 6, 7, 8
L_BLEND_REASON, L_STICK_LOW_REASON, L_STICK_HIGH_REASON, L_LEVER_REASON, L_RATE_REASON = 9, 10, 11, 12, 13
L_TIME, L_SIDE = 14, 15
"""Time to the corridor's boundary with the controls as they are [s], and its side (-1 low, 1 high, 0 none)."""
L_MARGIN = 16
"""Least margin predicted with the pilot's controls [m/s]."""
# ... what acted last, set by law_apply ...
L_ACTED, L_ACTED_STICK, L_ACTED_LEVER, L_ACTED_RATE = 17, 18, 19, 20
L_STICK_CAUSE, L_LEVER_CAUSE, L_RATE_CAUSE = 21, 22, 23
"""Reason for the change of each channel in this frame; 0 where there was none."""
# ... and memory from one decision to the next.
L_STARTED, L_BIAS, L_LAST_NACELLE_RATE, L_LAST_TORQUE, L_TORQUE_RATE, L_COLLECTIVE = 24, 25, 26, 27, 28, 29
L_FLAP_BIAS, L_RECOVER_SIDE, L_OVERRIDE, L_KIND = 30, 31, 32, 33
"""L_OVERRIDE 1: the pilot has switched the law's authority off. L_KIND: how the nacelle rate was limited (0 limit,
1 reverse)."""
LAW_STATE_SIZE = 34

FREE = 1e9
"""A bound that bounds nothing."""
CHANGE_STICK, CHANGE_LEVER, CHANGE_RATE = 1e-4, 1e-4, 1e-5
"""Changes smaller than these are rounding, not interventions [-, -, rad/s]."""


class LawSettings(NamedTuple):
    """Numbers of the laws, from ``data/protection.toml``. SI and radians."""

    period: float
    """Time between decisions [s]."""
    horizon: float
    """How far the laws look ahead [s]."""
    step: float
    """Step of that prediction [s]."""
    warning_horizon: float
    """How far the time to limit looks ahead [s]."""
    warning_step: float
    """Step of that prediction [s]."""
    bias_filter: float
    """Time constant with which the model's missing acceleration is learned [s]."""
    bias_decay: float
    """Time constant with which it is taken to die away [s]."""
    bias_limit: float
    """Largest missing acceleration taken into account [m/s^2]."""
    reverse_margin: float
    """Governor: predicted margin below which the nacelles are turned back [m/s]."""
    pass_margin: float
    """Governor: predicted margin with which a rate passes [m/s]."""
    apply: float
    """Governor: how long a rate is tried before the nacelles are stopped [s]."""
    reverse_rate: float
    """Governor: fastest rate at which the nacelles are turned back [rad/s]."""
    flat_high_nacelle: float
    """Governor: below this angle nacelle motion does not move the high-speed side [rad]."""
    finish_nacelle: float
    """Governor: from here forward the nacelles are run on to the downstop [rad]."""
    blend_begin: float
    """Full: predicted margin below which the recovery blends in [m/s]."""
    blend_full: float
    """Full: predicted margin at which it has taken over [m/s]."""
    blend_rise: float
    """Full: fastest growth of the blend [1/s]."""
    blend_fall: float
    """Full: fastest decay of the blend [1/s]."""
    recovery_margin: float
    """Full: margin the recovery aims at [m/s]."""
    recovery_step: float
    """Full: largest change of airspeed the recovery aims at [m/s]."""
    height_floor: float
    """Full: below this height stick and lever are not taken from the pilot [m]."""
    height_full: float
    """Full: from this height on they may be taken in full [m]."""
    sink_slope: float
    """Full: sine of the steepest descent the recovery may use."""
    sink_floor: float
    """Full: sink rate always allowed to the recovery [m/s]."""
    sink_limit: float
    """Full: sink rate always allowed to the pilot [m/s]."""
    sink_height: float
    """Full: height above which more is allowed [m]."""
    sink_time: float
    """Full: height above that, per sink rate allowed besides [s]."""
    flapping: float
    """Full: flapping kept to [rad]."""
    torque_share: float
    """Full: share of the torque limit kept to."""
    torque_lead: float
    """Full: how far the torque is extrapolated [s]."""
    collective_lag: float
    """Full: time constant of the collective actuator [s]."""
    pitch: float
    """Full: pitch attitude kept to [rad]."""
    pitch_frequency: float
    """Full: how sharply pitch may approach it [rad/s]."""


class TorqueTables(NamedTuple):
    """The mast-torque limit. SI and radians."""

    cruise: float
    """Limit in conversion and airplane mode [N m]."""
    takeoff: float
    """Limit in helicopter mode at low speed [N m]."""
    takeoff_nacelle: float
    """Nacelle angle above which the latter holds [rad]."""
    takeoff_airspeed: float
    """Airspeed below which it holds [m/s]."""


class ProtectionTables(NamedTuple):
    """One compiled law; read-only."""

    law: int
    """``LAW_*``."""
    every: int
    """Frames from one decision to the next."""
    model: ModelTables
    """The aircraft as the law knows it."""
    corridor: BoundaryTables
    """The boundaries it keeps to."""
    torque: TorqueTables
    """The torque it keeps to."""
    settings: LawSettings
    """Its numbers."""


@njit(cache=True, error_model="numpy")
def torque_limit(tables: TorqueTables, airspeed: float, nacelle: float) -> float:
    """Mast-torque limit at a condition [N m].

    Args:
        tables: The limits.
        airspeed: Airspeed [m/s].
        nacelle: Nacelle angle [rad].
    """
    if nacelle > tables.takeoff_nacelle and airspeed < tables.takeoff_airspeed:
        return tables.takeoff
    return tables.cruise


@njit(cache=True, error_model="numpy")
def law_release(state: FloatArray) -> None:
    """Let every command pass.

    Args:
        state: Law state, updated in place.
    """
    state[L_BLEND] = 0.0
    state[L_STICK_LOW], state[L_STICK_HIGH] = -FREE, FREE
    state[L_LEVER_LOW], state[L_LEVER_HIGH] = -FREE, FREE
    state[L_RATE_LOW], state[L_RATE_HIGH] = -FREE, FREE


@njit(cache=True, error_model="numpy")
def law_start(tables: ProtectionTables, state: FloatArray) -> None:
    """Set the state to that before the first decision.

    Args:
        tables: The law.
        state: Law state, overwritten.
    """
    state[:] = 0.0
    state[L_TIME] = tables.settings.warning_horizon
    state[L_MARGIN] = FREE
    law_release(state)


@njit(cache=True, error_model="numpy")
def _finite(values: FloatArray) -> bool:
    for i in range(values.shape[0]):
        if not math.isfinite(values[i]):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@njit(cache=True, error_model="numpy")
def _govern(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle: tuple[float, float, float],
    pilot_rate: float,
    out: FloatArray,
) -> None:
    """Bounds of the nacelle rate: turn back where even stopping leaves the corridor, else scale what the pilot asks for."""
    settings = tables.settings
    bias = (state[L_BIAS], settings.bias_decay)
    time = (settings.step, settings.horizon)
    guard = (settings.pitch, settings.pitch_frequency)
    state[L_RATE_LOW], state[L_RATE_HIGH] = -FREE, FREE
    state[L_KIND] = 0.0
    roll_out(tables.model, tables.corridor, cell, z, controls, nacelle, (0.0, 0.0), bias, time, guard, out)
    stopped = min(out[model.OUT_LOW], out[model.OUT_HIGH])
    stopped_low, stopped_high = out[model.OUT_LOW], out[model.OUT_HIGH]
    ends = min(out[model.OUT_LOW_END], out[model.OUT_HIGH_END])
    angle = nacelle[1]
    gated = angle <= tables.corridor.downstop_nacelle
    if stopped < settings.reverse_margin:
        low_side = stopped_low < stopped_high
        state[L_RATE_REASON] = REASON_LOW if low_side else REASON_HIGH
        state[L_KIND] = 1.0
        if not low_side and settings.finish_nacelle < angle <= settings.flat_high_nacelle:
            state[L_RATE_HIGH] = 0.0
            state[L_KIND] = 0.0
            return
        back = settings.reverse_rate if low_side else -settings.reverse_rate
        if not low_side and angle <= settings.finish_nacelle:
            state[L_RATE_HIGH] = back
            return
        roll_out(
            tables.model, tables.corridor, cell, z, controls, nacelle, (back, settings.horizon), bias, time, guard, out
        )
        turned = min(out[model.OUT_LOW_END], out[model.OUT_HIGH_END])
        # Aft is the way out on the low side and forward on the high side even where the nacelles' own pull or drag
        # costs margin at first: only a turn that is seen to suffice may be slower than the fastest.
        share = 1.0
        if turned > settings.reverse_margin:
            share = _clip((settings.reverse_margin - ends) / (turned - ends), 0.25, 1.0)
        if low_side:
            state[L_RATE_LOW] = share * back
        else:
            state[L_RATE_HIGH] = share * back
        return
    if pilot_rate == 0.0:
        return
    trial = 1.0
    roll_out(
        tables.model, tables.corridor, cell, z, controls, nacelle, (pilot_rate, settings.apply), bias, time, guard, out
    )
    margin = min(out[model.OUT_LOW], out[model.OUT_HIGH])
    low_side = out[model.OUT_LOW] < out[model.OUT_HIGH]
    if margin >= settings.pass_margin or margin >= stopped:
        return
    if stopped <= settings.pass_margin:
        trial = 0.0
    else:
        # The margin falls about linearly with the rate; what the secant allows is tried once more.
        trial = (stopped - settings.pass_margin) / (stopped - margin)
        roll_out(
            tables.model, tables.corridor, cell, z, controls, nacelle, (trial * pilot_rate, settings.apply), bias, time, guard, out
        )
        if min(out[model.OUT_LOW], out[model.OUT_HIGH]) < settings.pass_margin:
            trial *= 0.5
    if gated and not low_side:
        trial = 0.0
    if pilot_rate < 0.0:
        state[L_RATE_LOW] = trial * pilot_rate
    else:
        state[L_RATE_HIGH] = trial * pilot_rate
    state[L_RATE_REASON] = REASON_LOW if low_side else (REASON_GATE if gated else REASON_HIGH)


@njit(cache=True, error_model="numpy")
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
    low, high = speed_range(tables.corridor, angle)
    aim = airspeed
    if state[L_RECOVER_SIDE] < 0.0:
        aim = max(airspeed, low + settings.recovery_margin)
        state[L_BLEND_REASON] = REASON_LOW
    elif state[L_RECOVER_SIDE] == 0.0:
        state[L_BLEND_REASON] = REASON_SINK
    else:
        aim = min(airspeed, high - settings.recovery_margin)
        state[L_BLEND_REASON] = REASON_HIGH
    step = _clip(aim - airspeed, -settings.recovery_step, settings.recovery_step)
    allowed = max(settings.sink_floor, settings.sink_slope * abs(airspeed))
    excess = -climb - allowed
    if step > 0.0 and excess > 0.0:
        # Height is not traded for speed beyond the allowed descent.
        step *= max(0.0, 1.0 - excess / allowed)
        state[L_BLEND_REASON] = REASON_SINK
    model_at(tables.model, airspeed + step, angle, target)
    d0 = z[0] - target[model.C_STATE]
    d1 = z[1] - target[model.C_STATE + 1]
    d2 = z[2] - target[model.C_STATE + 2]
    d3 = z[3] - target[model.C_STATE + 3]
    g = model.C_GAIN
    stick = target[model.C_CONTROL] - (cell[g] * d0 + cell[g + 1] * d1 + cell[g + 2] * d2 + cell[g + 3] * d3)
    lever = target[model.C_CONTROL + 1] - (cell[g + 4] * d0 + cell[g + 5] * d1 + cell[g + 6] * d2 + cell[g + 7] * d3)
    state[L_STICK] = _clip(stick, -1.0, 1.0)
    state[L_LEVER] = _clip(lever, 0.0, 1.0)


@njit(cache=True, error_model="numpy")
def _limit_stick(
    tables: ProtectionTables,
    state: FloatArray,
    cell: FloatArray,
    z: tuple[float, float, float, float],
    controls: tuple[float, float],
    nacelle_rate: float,
    measured_flapping: float,
) -> None:
    """Bounds of the stick that keep pitch attitude, and with priority flapping, inside."""
    settings = tables.settings
    low, high = -FREE, FREE
    low_reason, high_reason = REASON_NONE, REASON_NONE
    power = cell[model.C_B + 6]
    if power < -0.2:
        _, _, at_rest, _, _ = accelerations(cell, z, (0.0, controls[1]), (0.0, nacelle_rate))
        f = settings.pitch_frequency
        up = f * f * (settings.pitch - z[3]) - 2.0 * f * z[2]
        down = -f * f * (settings.pitch + z[3]) - 2.0 * f * z[2]
        low, high = (up - at_rest) / power, (down - at_rest) / power
        low_reason, high_reason = REASON_PITCH, REASON_PITCH

    slope_c, slope_s = cell[model.C_FLAP_C + 4], cell[model.C_FLAP_S + 4]
    square = slope_c * slope_c + slope_s * slope_s
    now_c = affine(cell, model.C_FLAP_C, z, controls, nacelle_rate)
    now_s = affine(cell, model.C_FLAP_S, z, controls, nacelle_rate)
    missed = _clip(measured_flapping - math.sqrt(now_c * now_c + now_s * now_s), -0.02, 0.05)
    state[L_FLAP_BIAS] += settings.period / settings.bias_filter * (missed - state[L_FLAP_BIAS])
    if square > 0.0025:  # 2.9 deg per half travel: less is no means to limit flapping
        reach = max(settings.flapping - max(state[L_FLAP_BIAS], 0.0), 0.05)
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
    state[L_STICK_LOW], state[L_STICK_HIGH] = _clip(low, -1.0, 1.0), _clip(high, -1.0, 1.0)
    state[L_STICK_LOW_REASON], state[L_STICK_HIGH_REASON] = low_reason, high_reason


@njit(cache=True, error_model="numpy")
def _limit_lever(
    tables: ProtectionTables, state: FloatArray, cell: FloatArray, torque: float, airspeed: float, angle: float
) -> None:
    """Upper bound of the lever that keeps the mast torque, by feedback of the measured torque."""
    settings = tables.settings
    dt = settings.period
    sensitivity = max(cell[model.C_TORQUE + 5], 1e3)
    moved = dt / settings.collective_lag * (state[L_ACTED_LEVER] - state[L_COLLECTIVE])
    own = sensitivity * moved / dt
    rate = (torque - state[L_LAST_TORQUE]) / dt - own if state[L_STARTED] != 0.0 else 0.0
    state[L_TORQUE_RATE] += 0.2 * (rate - state[L_TORQUE_RATE])
    state[L_COLLECTIVE] += moved
    room = settings.torque_share * torque_limit(tables.torque, airspeed, angle) - torque
    room -= settings.torque_lead * max(state[L_TORQUE_RATE], 0.0)
    state[L_LEVER_HIGH] = _clip(state[L_COLLECTIVE] + room / sensitivity, 0.0, 1.0)
    state[L_LEVER_REASON] = REASON_TORQUE


@njit(cache=True, error_model="numpy")
def law_decide(
    tables: ProtectionTables, state: FloatArray, sensors: FloatArray, command: FloatArray, work: FloatArray
) -> None:
    """Decide what is allowed until the next decision.

    Args:
        tables: The law.
        state: Law state, updated in place, shape (LAW_STATE_SIZE,).
        sensors: What the law may know, shape (SENSOR_COUNT,).
        command: Stick, lever, nacelle rate [rad/s] that would act without the law.
        work: Scratch of WORK_SIZE numbers.
    """
    settings = tables.settings
    if not (_finite(sensors) and _finite(command)):
        # A law that cannot see does not act.
        law_release(state)
        state[L_STARTED] = 0.0
        state[L_TIME], state[L_SIDE] = settings.warning_horizon, 0.0
        return
    cell, target = work[: model.CELL_SIZE], work[model.CELL_SIZE : 2 * model.CELL_SIZE]
    out = work[2 * model.CELL_SIZE : 2 * model.CELL_SIZE + model.ROLL_OUT_SIZE]
    dt = settings.period
    airspeed, angle, rate = sensors[SENSE_AIRSPEED], sensors[SENSE_NACELLE], sensors[SENSE_NACELLE_RATE]
    pitch, climb = sensors[SENSE_PITCH], sensors[SENSE_CLIMB_RATE]
    sine, cosine = math.sin(pitch), math.cos(pitch)
    z = (airspeed * cosine + climb * sine, airspeed * sine - climb * cosine, sensors[SENSE_PITCH_RATE], pitch)
    asked = (_clip(command[0], -1.0, 1.0), _clip(command[1], 0.0, 1.0))
    if state[L_STARTED] == 0.0:
        state[L_ACTED_STICK], state[L_ACTED_LEVER], state[L_ACTED_RATE] = asked[0], asked[1], 0.0
        state[L_COLLECTIVE] = asked[1]
        state[L_LAST_NACELLE_RATE] = rate
    acting = (state[L_ACTED_STICK], state[L_ACTED_LEVER])
    model_at(tables.model, airspeed, angle, cell)

    _, _, _, expected, _ = accelerations(cell, z, acting, (0.0, rate))
    missing = _clip(sensors[SENSE_AIRSPEED_RATE] - expected, -settings.bias_limit, settings.bias_limit)
    state[L_BIAS] += dt / settings.bias_filter * (missing - state[L_BIAS])
    bias = (state[L_BIAS], settings.bias_decay)
    # The filter's command angle follows from its motion: n'' = w^2 (c - n) - 2 w n'.
    w = tables.model.nacelle_frequency
    turning = (rate - state[L_LAST_NACELLE_RATE]) / dt
    state[L_LAST_NACELLE_RATE] = rate
    commanded = _clip(angle + (2.0 * rate + turning / w) / w, tables.model.forward_stop, tables.model.aft_stop)
    nacelle = (commanded, angle, rate)
    if sensors[SENSE_NACELLE_OK] == 0.0:
        nacelle = (angle, angle, 0.0)

    horizon = settings.warning_horizon
    held = state[L_ACTED_RATE] if sensors[SENSE_NACELLE_OK] != 0.0 else 0.0
    roll_out(
        tables.model, tables.corridor, cell, z, acting, nacelle, (held, horizon), bias, (settings.warning_step, horizon),
        (settings.pitch, settings.pitch_frequency), out,
    )  # fmt: skip
    state[L_TIME], state[L_SIDE] = out[model.OUT_TIME], out[model.OUT_SIDE]
    law_release_unblended(state)
    if tables.law == LAW_GOVERNOR:
        _govern(tables, state, cell, z, asked, nacelle, command[2], out)
    elif tables.law == LAW_FULL:
        _govern(tables, state, cell, z, acting, nacelle, command[2], out)
        _blend(tables, state, (cell, target, out), z, asked, nacelle, command[2], (airspeed, angle, climb), sensors[SENSE_ALTITUDE])
        _limit_stick(tables, state, cell, z, acting, rate, sensors[SENSE_FLAPPING])
        _limit_lever(tables, state, cell, sensors[SENSE_TORQUE], airspeed, angle)
    state[L_LAST_TORQUE] = sensors[SENSE_TORQUE]
    state[L_STARTED] = 1.0


@njit(cache=True, error_model="numpy")
def law_release_unblended(state: FloatArray) -> None:
    """Take the bounds away and leave the blend to its own decay.

    Args:
        state: Law state, updated in place.
    """
    blend = state[L_BLEND]
    law_release(state)
    state[L_BLEND] = blend


@njit(cache=True, error_model="numpy")
def _blend(
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
    """How much of stick and lever the recovery takes, and its controls."""
    cell, target, out = work
    settings = tables.settings
    dt = settings.period
    bias = (state[L_BIAS], settings.bias_decay)
    allowed = _clip(pilot_rate, state[L_RATE_LOW], state[L_RATE_HIGH])
    roll_out(
        tables.model, tables.corridor, cell, z, asked, nacelle, (allowed, 0.5 * settings.horizon), bias,
        (settings.step, settings.horizon), (settings.pitch, settings.pitch_frequency), out,
    )  # fmt: skip
    low, high = out[model.OUT_LOW], out[model.OUT_HIGH]
    margin = min(low, high)
    state[L_MARGIN] = margin
    wanted = _clip((settings.blend_begin - margin) / (settings.blend_begin - settings.blend_full), 0.0, 1.0)
    if wanted > 0.0:
        state[L_RECOVER_SIDE] = -1.0 if low < high else 1.0
    airspeed, _, climb = flight
    sink = max(settings.sink_limit, settings.sink_slope * abs(airspeed))
    sink += max(0.0, altitude - settings.sink_height) / settings.sink_time
    sinking = _clip((-climb - sink) / (0.3 * sink), 0.0, 1.0)
    if sinking > wanted:
        wanted = sinking
        if state[L_BLEND] == 0.0 or state[L_RECOVER_SIDE] == 0.0:
            state[L_RECOVER_SIDE] = 0.0
    wanted = min(wanted, _clip((altitude - settings.height_floor) / (settings.height_full - settings.height_floor), 0.0, 1.0))
    state[L_BLEND] += _clip(wanted - state[L_BLEND], -settings.blend_fall * dt, settings.blend_rise * dt)
    if state[L_BLEND] > 0.0:
        _recover(tables, state, cell, target, z, flight)


@njit(cache=True, error_model="numpy")
def law_apply(tables: ProtectionTables, state: FloatArray, command: FloatArray, applied: FloatArray) -> None:
    """Limit this frame's command by what was decided last.

    Args:
        tables: The law.
        state: Law state; what acted and why is noted in it.
        command: Stick, lever, nacelle rate [rad/s] without the law.
        applied: Written: the same with the law; may be the same array.
    """
    stick, lever, rate = command[0], command[1], command[2]
    # A command that is no number is answered with what acted last.
    if not math.isfinite(stick):
        stick = state[L_ACTED_STICK]
    if not math.isfinite(lever):
        lever = state[L_ACTED_LEVER]
    if not math.isfinite(rate):
        rate = 0.0
    applied[0], applied[1], applied[2] = stick, lever, rate
    state[L_STICK_CAUSE], state[L_LEVER_CAUSE], state[L_RATE_CAUSE] = 0.0, 0.0, 0.0
    if tables.law >= LAW_GOVERNOR and state[L_OVERRIDE] == 0.0:
        applied[2] = _clip(rate, state[L_RATE_LOW], state[L_RATE_HIGH])
        if abs(applied[2] - rate) > CHANGE_RATE:
            state[L_RATE_CAUSE] = state[L_RATE_REASON]
        if tables.law == LAW_FULL:
            _apply_hands(state, stick, lever, applied)
    state[L_ACTED] = 1.0
    state[L_ACTED_STICK] = _clip(applied[0], -1.0, 1.0)
    state[L_ACTED_LEVER] = _clip(applied[1], 0.0, 1.0)
    state[L_ACTED_RATE] = applied[2]


@njit(cache=True, error_model="numpy")
def _apply_hands(state: FloatArray, stick: float, lever: float, applied: FloatArray) -> None:
    blend = state[L_BLEND]
    if blend > 0.0:
        applied[0] = stick + blend * (state[L_STICK] - stick)
        applied[1] = lever + blend * (state[L_LEVER] - lever)
        if abs(applied[0] - stick) > CHANGE_STICK:
            state[L_STICK_CAUSE] = state[L_BLEND_REASON]
        if abs(applied[1] - lever) > CHANGE_LEVER:
            state[L_LEVER_CAUSE] = state[L_BLEND_REASON]
    before = applied[0]
    applied[0] = _clip(before, state[L_STICK_LOW], state[L_STICK_HIGH])
    if applied[0] > before + CHANGE_STICK:
        state[L_STICK_CAUSE] = state[L_STICK_LOW_REASON]
    elif applied[0] < before - CHANGE_STICK:
        state[L_STICK_CAUSE] = state[L_STICK_HIGH_REASON]
    before = applied[1]
    applied[1] = _clip(before, state[L_LEVER_LOW], state[L_LEVER_HIGH])
    if abs(applied[1] - before) > CHANGE_LEVER:
        state[L_LEVER_CAUSE] = state[L_LEVER_REASON]


@njit(cache=True, error_model="numpy")
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
        tables: The law.
        state: Law state, updated in place.
        frame: Number of the frame; the law decides when it is a multiple of ``tables.every``.
        sensors: What the law may know; read only in frames in which it decides.
        command: Stick, lever, nacelle rate [rad/s] without the law.
        applied: Written: the same with the law; may be the same array.
        work: Scratch of WORK_SIZE numbers.
    """
    if tables.law != LAW_OFF and (frame % tables.every == 0 or state[L_STARTED] == 0.0):
        law_decide(tables, state, sensors, command, work)
    law_apply(tables, state, command, applied)


WORK_SIZE = 2 * model.CELL_SIZE + model.ROLL_OUT_SIZE
"""Length of the scratch array of the laws."""
