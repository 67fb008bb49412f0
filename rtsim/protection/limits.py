"""The numbers of the limits that are watched, and of the laws, from an aircraft's profile."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, Part, xv15_profile
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.protection.law_data import LawSettings, SidewaysLimits, SinkTables, TorqueTables
from rtsim.protection.model import RegulatorWeights
from rtsim.protection.monitor_kernels import LIMIT_NUMBERS, LIMIT_WORDS, RotorTables
from rtsim.units import DEGREE, HORSEPOWER, INCH_POUND, KNOT, deg, kt

LIMIT_KINDS = tuple(name for name in LIMIT_WORDS if name != "time_to_limit")
"""Limits by name; the number of a limit is its place here, and a recorded reason is that number plus one."""
OPTIONAL = ("engine_power", "transmission", "rotor_endurance", "bank_attitude", "sideslip")
"""Limits that an aircraft's data need not name; they are not watched then."""
_SI = {"_deg_s": DEGREE, "_deg": DEGREE}
"""SI value of one unit of a limit, by how its key ends; 1 for others."""


class Limits(SimpleNamespace):
    """Limits besides the corridor, those of ``LIMIT`` by name among them. SI and radians."""

    torque: TorqueTables
    """Mast torque."""
    sink: SinkTables
    """Sink rate."""
    rotor: RotorTables
    """Transmission and rotor endurance."""
    sideways: SidewaysLimits
    """Bank and sideslip."""
    alpha_speed: float
    """Added to the airspeed where sideslip is an angle, as for scheduling [m/s]."""
    plant_guard: float
    """Distance a law's low side keeps from where the plant's unstalled trims end [m/s]."""


@lru_cache(maxsize=8)
def load_limits(profile: AircraftProfile | None = None) -> Limits:
    """Give an aircraft's limits.

    Raises:
        InputError: A value is missing or out of range.
    """
    profile = xv15_profile() if profile is None else profile
    data = profile.protection.table("limits")
    engines = profile.systems.table("engine")
    return Limits(
        rotor=_rotor(data, engines=engines.number("engines", low=1, high=8)),
        torque=TorqueTables(
            cruise=data.number("mast_torque_inlb", low=1.0, high=1e9) * INCH_POUND,
            takeoff=data.number("mast_torque_takeoff_inlb", low=1.0, high=1e9) * INCH_POUND,
            takeoff_nacelle=deg(data.number("takeoff_nacelle_above_deg", low=0.0, high=95.0)),
            takeoff_airspeed=kt(data.number("takeoff_airspeed_below_kt", low=0.0, high=300.0)),
        ),
        sink=SinkTables(
            floor=data.number("sink_rate_m_s", low=0.1, high=100.0),
            slope=math.sin(deg(data.number("sink_angle_deg", low=0.0, high=60.0))),
            height=data.number("sink_height_m", low=0.0, high=1e4),
            time=data.number("sink_time_s", low=0.1, high=1e4),
        ),
        sideways=_sideways(data),
        alpha_speed=profile.dimensions.number("scheduling_speed_m_s", low=0.1, high=100.0),
        plant_guard=kt(data.number("plant_guard_kt", low=0.0, high=100.0)),
        **{
            name: data.number(key, low=low, high=high) * next((_SI[end] for end in _SI if key.endswith(end)), 1.0)
            for name, (key, low, high) in LIMIT_NUMBERS.items()
        },
    )


def _sideways(data: Part) -> SidewaysLimits:
    """Limits of bank and of sideslip, where the data name them."""
    if not data.has("bank_deg"):
        return SidewaysLimits(math.inf, math.inf, 0.0, math.inf, math.inf, 0.0, 1.0)
    return SidewaysLimits(
        bank=deg(data.number("bank_deg", low=1.0, high=80.0)),
        bank_helicopter=deg(data.number("bank_helicopter_deg", low=1.0, high=80.0)),
        bank_nacelle=deg(data.number("bank_up_to_nacelle_deg", low=0.0, high=89.0)),
        slow=kt(data.number("sideward_slow_kt", low=1.0, high=300.0)),
        fast=kt(data.number("sideward_fast_kt", low=1.0, high=300.0)),
        slow_below=kt(data.number("sideward_slow_below_kt", low=0.0, high=300.0)),
        fast_above=kt(data.number("sideward_fast_above_kt", low=1.0, high=300.0)),
    )


def _rotor(data: Part, *, engines: float) -> RotorTables:
    """What transmission and rotors bear, where the data say."""
    transmission = math.inf
    angles: list[float] = []
    ratios: list[float] = [0.0]
    limits: list[list[float]] = []
    if data.has("helicopter_transmission_shp"):
        transmission = engines * data.number("helicopter_transmission_shp", low=1.0, high=1e5) * HORSEPOWER
    if data.has("rotor_endurance"):
        part = data.table("rotor_endurance")
        angles = part.numbers("nacelle_deg", low=0.0, high=95.0, least=2, rises=True)
        ratios = part.numbers("advance_ratio", low=0.0, high=2.0, least=2, rises=True)
        keys = [f"nacelle_{angle:g}" for angle in angles]
        limits = [part.numbers(key, low=1e-4, high=1.0, count=len(ratios)) for key in keys]
    return RotorTables(
        transmission=transmission,
        helicopter=deg(data.number("takeoff_nacelle_above_deg", low=0.0, high=95.0)),
        nacelle=np.radians(angles),
        advance_ratio=np.array(ratios),
        endurance=np.array(limits).reshape(len(angles), len(ratios)),
    )


UNIT_SCALE = {"kn": KNOT, "deg": DEGREE, "deg/s": DEGREE, "%": 0.01, "": 1.0, "m/s": 1.0, "s": 1.0}
"""SI value of one unit of the levels' data."""
TOLD_FROM = 2.0
"""Lowest level that is told of a limit that has all three: a caution of the torque, say, belongs to every climb."""
_LEVELS = 3
WATCHED = tuple(LIMIT_WORDS)
"""What has a margin and a level, in the order of the arrays."""


@dataclass(frozen=True, slots=True, eq=False)
class LimitLevels:
    """When each limit cautions, warns and counts as exceeded; rows in the order of ``WATCHED``. SI."""

    units: tuple[str, ...]
    """Unit in which people are told of the margin."""
    scale: FloatArray
    """SI value of that unit."""
    threshold: FloatArray
    """Margins below which caution, warning and exceedance begin, shape (limits, 3); minus infinity: they never do."""
    outside: FloatArray
    """Margins below which a limit is passed: where its last level begins."""
    told_from: FloatArray
    """Lowest level that people are told of, by number."""
    hysteresis: FloatArray
    """How far above its threshold a margin must rise before the level ends."""
    rise: float
    """How long the margin must be below [s]."""
    fall: float
    """How long it must be above [s]."""


@lru_cache(maxsize=8)
def load_levels(profile: AircraftProfile | None = None) -> LimitLevels:
    """Give the levels of an aircraft's limits.

    Raises:
        InputError: A value is missing or out of range.
    """
    data = _part(profile).table("levels")
    units, rows, hysteresis = [], [], []
    for name in WATCHED:
        unit, row, back = "", [-math.inf], 0.0
        if data.has(name) or name not in OPTIONAL:
            part = data.table(name)
            unit, row = part.text("unit"), part.numbers("threshold", low=-1e6, high=1e6)
            back = part.number("hysteresis", low=0.0, high=1e6)
            if unit not in UNIT_SCALE:
                allowed = ", ".join(UNIT_SCALE)
                raise InputError("is not a unit", file=part.file, key=f"{part.name}.unit", value=unit, allowed=allowed)
            if len(row) not in (1, _LEVELS):
                allowed = f"one margin for a caution, or {_LEVELS}"
                key = f"{part.name}.threshold"
                raise InputError("has the wrong length", file=part.file, key=key, value=row, allowed=allowed)
        units.append(unit)
        rows.append([UNIT_SCALE[unit] * margin for margin in row])
        hysteresis.append(UNIT_SCALE[unit] * back)
    return LimitLevels(
        units=tuple(units),
        scale=np.array([UNIT_SCALE[unit] for unit in units]),
        threshold=np.array([row + [-math.inf] * (_LEVELS - len(row)) for row in rows]),
        outside=np.array([row[-1] for row in rows]),
        told_from=np.array([1.0 if len(row) == 1 else TOLD_FROM for row in rows]),
        hysteresis=np.array(hysteresis),
        rise=data.number("rise_s", low=0.0, high=60.0),
        fall=data.number("fall_s", low=0.0, high=60.0),
    )


def load_weights(profile: AircraftProfile | None = None) -> RegulatorWeights:
    """Give the weights of the recovery's regulator.

    Raises:
        InputError: A value is missing or out of range.
    """
    data = _part(profile).table("regulator")
    return RegulatorWeights(
        airspeed=data.number("airspeed_m_s", low=0.01, high=100.0),
        climb_rate=data.number("climb_rate_m_s", low=0.01, high=100.0),
        pitch=deg(data.number("pitch_deg", low=0.01, high=90.0)),
        pitch_rate=deg(data.number("pitch_rate_deg_s", low=0.01, high=200.0)),
        stick=data.number("stick", low=0.001, high=10.0),
        lever=data.number("lever", low=0.001, high=10.0),
    )


def load_settings(profile: AircraftProfile | None = None, *, dt: float) -> LawSettings:
    """Give the numbers of the built-in laws.

    Args:
        dt: Length of a frame [s]; the time between decisions is a whole number of frames.

    Raises:
        InputError: A value is missing or out of range.
    """
    part = _part(profile)
    law, governor, full = part.table("law"), part.table("governor"), part.table("full")
    limits = load_limits(profile)
    turn = part.table("turn") if part.has("turn") else xv15_profile().protection.table("turn")
    load_buffer = turn.number("load_factor_buffer", low=0.0, high=5.0)
    return LawSettings(
        period=frames_per_decision(profile, dt=dt) * dt,
        horizon=law.number("horizon_s", low=0.1, high=60.0),
        step=law.number("prediction_step_s", low=0.01, high=2.0),
        warning_horizon=law.number("warning_horizon_s", low=0.1, high=60.0),
        warning_step=law.number("warning_step_s", low=0.01, high=2.0),
        bias_filter=law.number("bias_filter_s", low=0.01, high=60.0),
        bias_decay=law.number("bias_decay_s", low=0.01, high=60.0),
        bias_limit=law.number("bias_limit_m_s2", low=0.0, high=20.0),
        reverse_margin=kt(governor.number("reverse_margin_kt", low=-50.0, high=100.0)),
        pass_margin=kt(governor.number("pass_margin_kt", low=-50.0, high=100.0)),
        apply=governor.number("apply_s", low=0.0, high=10.0),
        reverse_rate=deg(governor.number("reverse_rate_deg_s", low=0.1, high=60.0)),
        flat_high_nacelle=deg(governor.number("flat_high_nacelle_deg", low=0.0, high=95.0)),
        finish_nacelle=deg(governor.number("finish_nacelle_deg", low=0.0, high=95.0)),
        blend_begin=kt(full.number("blend_begin_kt", low=-50.0, high=100.0)),
        blend_full=kt(full.number("blend_full_kt", low=-50.0, high=100.0)),
        blend_rise=full.number("blend_rise_per_s", low=0.01, high=1000.0),
        blend_fall=full.number("blend_fall_per_s", low=0.01, high=1000.0),
        recovery_margin=kt(full.number("recovery_margin_kt", low=0.0, high=200.0)),
        recovery_step=kt(full.number("recovery_step_kt", low=0.0, high=200.0)),
        height_floor=full.number("height_floor_m", low=0.0, high=1e4),
        height_full=full.number("height_full_m", low=0.0, high=1e4),
        sink_slope=limits.sink.slope,
        sink_floor=full.number("sink_rate_floor_m_s", low=0.0, high=100.0),
        flapping=deg(full.number("flapping_deg", low=0.1, high=60.0)),
        torque_share=full.number("torque_share", low=0.1, high=1.0),
        torque_lead=full.number("torque_lead_s", low=0.0, high=10.0),
        collective_lag=full.number("collective_lag_s", low=0.001, high=10.0),
        pitch=deg(full.number("pitch_deg", low=1.0, high=80.0)),
        pitch_frequency=full.number("pitch_frequency_rad_s", low=0.01, high=20.0),
        load_factor_max=limits.load_factor_max - load_buffer,
        load_factor_min=limits.load_factor_min + load_buffer,
        load_frequency=turn.number("load_frequency_rad_s", low=0.01, high=20.0),
        turn_lead=turn.number("lead_s", low=0.0, high=5.0),
        turn_margin=kt(turn.number("margin_kt", low=-50.0, high=100.0)),
        turn_time=turn.number("margin_lead_s", low=0.0, high=10.0),
        bank_least=deg(turn.number("bank_least_deg", low=0.0, high=60.0)),
        bank_buffer=deg(turn.number("bank_buffer_deg", low=0.0, high=30.0)),
        bank_frequency=turn.number("bank_frequency_rad_s", low=0.01, high=20.0),
        sideslip_buffer=kt(turn.number("sideward_buffer_kt", low=0.0, high=50.0)),
        sideslip_frequency=turn.number("sideslip_frequency_rad_s", low=0.01, high=20.0),
        drift_time=turn.number("drift_time_s", low=0.1, high=60.0),
        even_roll=turn.number("even_roll_rad_s2", low=0.0, high=100.0),
        uneven_roll=turn.number("uneven_roll_rad_s2", low=0.0, high=100.0),
        uneven_lever=turn.number("uneven_lever", low=0.0, high=1.0),
        twist_share=turn.number("twist_share", low=0.0, high=1.0),
        differential_lag=turn.number("differential_lag_s", low=0.001, high=10.0),
        roll_filter=turn.number("roll_filter_s", low=0.01, high=60.0),
    )


def frames_per_decision(profile: AircraftProfile | None = None, *, dt: float) -> int:
    """Frames from one decision of a law to the next."""
    return max(1, round(1.0 / (_part(profile).table("law").number("rate_hz", low=1.0, high=1000.0) * dt)))


def _part(profile: AircraftProfile | None) -> Part:
    return (xv15_profile() if profile is None else profile).protection
