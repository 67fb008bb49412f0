"""The limits that are watched, their names and numbers, from ``data/protection.toml``."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Literal

from rtsim.protection.law_data import LawSettings, SinkTables, TorqueTables
from rtsim.protection.model import RegulatorWeights
from rtsim.units import INCH_POUND, deg, kt

LimitKind = Literal[
    "stall_attitude",
    "load_torque",
    "downstop_gate",
    "nacelle_range",
    "nacelle_rate",
    "flap_stop",
    "mast_torque",
    "load_factor",
    "pitch_attitude",
    "consistency",
    "sink",
]
LIMIT_KINDS: tuple[LimitKind, ...] = (
    "stall_attitude",
    "load_torque",
    "downstop_gate",
    "nacelle_range",
    "nacelle_rate",
    "flap_stop",
    "mast_torque",
    "load_factor",
    "pitch_attitude",
    "consistency",
    "sink",
)
"""Limits by name; the number of a limit is its place here, and a recorded reason is that number plus one."""
LIMIT_WORDS: dict[str, str] = {
    "stall_attitude": "low-speed side of the corridor",
    "load_torque": "high-speed side of the corridor",
    "downstop_gate": "downstop gate",
    "nacelle_range": "nacelle range",
    "nacelle_rate": "nacelle rate",
    "flap_stop": "flapping",
    "mast_torque": "mast torque",
    "load_factor": "load factor",
    "pitch_attitude": "pitch attitude",
    "consistency": "aircraft's own trims",
    "sink": "sink rate",
    "time_to_limit": "time to the corridor's boundary",
}
"""Limits, and the time to the corridor's boundary, in words for people."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits besides the corridor. SI and radians."""

    flapping: float
    """Gimbal flapping at the stop [rad]."""
    torque: TorqueTables
    """Mast torque."""
    sink: SinkTables
    """Sink rate."""
    load_factor_max: float
    """Largest load factor."""
    load_factor_min: float
    """Smallest load factor."""
    pitch: float
    """Pitch attitude, either way [rad]."""
    nacelle_forward: float
    """Smallest nacelle angle [rad]."""
    nacelle_aft: float
    """Largest nacelle angle [rad]."""
    nacelle_rate: float
    """Fastest nacelle motion [rad/s]."""
    plant_guard: float
    """Distance a law's low side keeps from where the plant's unstalled trims end [m/s]."""


@cache
def protection_data() -> dict[str, Any]:
    """Read ``data/protection.toml``."""
    text = resources.files("rtsim.aircraft.xv15").joinpath("data", "protection.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def load_limits() -> Limits:
    """Give the XV-15's limits."""
    data = protection_data()["limits"]
    return Limits(
        flapping=deg(data["flapping_deg"]),
        torque=TorqueTables(
            cruise=data["mast_torque_inlb"] * INCH_POUND,
            takeoff=data["mast_torque_takeoff_inlb"] * INCH_POUND,
            takeoff_nacelle=deg(data["takeoff_nacelle_above_deg"]),
            takeoff_airspeed=kt(data["takeoff_airspeed_below_kt"]),
        ),
        sink=SinkTables(
            floor=data["sink_rate_m_s"],
            slope=math.sin(deg(data["sink_angle_deg"])),
            height=data["sink_height_m"],
            time=data["sink_time_s"],
        ),
        load_factor_max=data["load_factor_max"],
        load_factor_min=data["load_factor_min"],
        pitch=deg(data["pitch_deg"]),
        nacelle_forward=deg(data["nacelle_forward_deg"]),
        nacelle_aft=deg(data["nacelle_aft_deg"]),
        nacelle_rate=deg(data["nacelle_rate_deg_s"]),
        plant_guard=kt(data["plant_guard_kt"]),
    )


def load_weights() -> RegulatorWeights:
    """Give the weights of the recovery's regulator."""
    data = protection_data()["regulator"]
    return RegulatorWeights(
        airspeed=data["airspeed_m_s"],
        climb_rate=data["climb_rate_m_s"],
        pitch=deg(data["pitch_deg"]),
        pitch_rate=deg(data["pitch_rate_deg_s"]),
        stick=data["stick"],
        lever=data["lever"],
    )


def load_settings(*, dt: float) -> LawSettings:
    """Give the numbers of the built-in laws.

    Args:
        dt: Length of a frame [s]; the time between decisions is a whole number of frames.
    """
    data = protection_data()
    law, governor, full = data["law"], data["governor"], data["full"]
    return LawSettings(
        period=frames_per_decision(dt) * dt,
        horizon=law["horizon_s"],
        step=law["prediction_step_s"],
        warning_horizon=law["warning_horizon_s"],
        warning_step=law["warning_step_s"],
        bias_filter=law["bias_filter_s"],
        bias_decay=law["bias_decay_s"],
        bias_limit=law["bias_limit_m_s2"],
        reverse_margin=kt(governor["reverse_margin_kt"]),
        pass_margin=kt(governor["pass_margin_kt"]),
        apply=governor["apply_s"],
        reverse_rate=deg(governor["reverse_rate_deg_s"]),
        flat_high_nacelle=deg(governor["flat_high_nacelle_deg"]),
        finish_nacelle=deg(governor["finish_nacelle_deg"]),
        blend_begin=kt(full["blend_begin_kt"]),
        blend_full=kt(full["blend_full_kt"]),
        blend_rise=full["blend_rise_per_s"],
        blend_fall=full["blend_fall_per_s"],
        recovery_margin=kt(full["recovery_margin_kt"]),
        recovery_step=kt(full["recovery_step_kt"]),
        height_floor=full["height_floor_m"],
        height_full=full["height_full_m"],
        sink_slope=math.sin(deg(data["limits"]["sink_angle_deg"])),
        sink_floor=full["sink_rate_floor_m_s"],
        flapping=deg(full["flapping_deg"]),
        torque_share=full["torque_share"],
        torque_lead=full["torque_lead_s"],
        collective_lag=full["collective_lag_s"],
        pitch=deg(full["pitch_deg"]),
        pitch_frequency=full["pitch_frequency_rad_s"],
    )


def frames_per_decision(dt: float) -> int:
    """Frames from one decision of a law to the next.

    Args:
        dt: Length of a frame [s].
    """
    return max(1, round(1.0 / (float(protection_data()["law"]["rate_hz"]) * dt)))
