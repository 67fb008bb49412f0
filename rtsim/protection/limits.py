"""The numbers of the limits that are watched, and of the laws, from ``data/protection.toml``."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib import resources
from types import SimpleNamespace
from typing import Any

from rtsim.protection.law_data import LawSettings, SinkTables, TorqueTables
from rtsim.protection.model import RegulatorWeights
from rtsim.protection.monitor_kernels import LIMIT_WORDS
from rtsim.units import DEGREE, INCH_POUND, KNOT, deg, kt

LIMIT_KINDS = tuple(name for name in LIMIT_WORDS if name != "time_to_limit")
"""Limits by name; the number of a limit is its place here, and a recorded reason is that number plus one."""
_SCALES = {"_deg_s": DEGREE, "_deg": DEGREE, "_kt": KNOT, "_inlb": INCH_POUND, "_m_s": 1.0, "_m": 1.0, "_s": 1.0}


class Limits(SimpleNamespace):
    """Limits besides the corridor: every number under ``[limits]`` by its key without the unit, SI and radians."""

    torque: TorqueTables
    """Mast torque."""
    sink: SinkTables
    """Sink rate."""


@cache
def protection_data() -> dict[str, Any]:
    """Read ``data/protection.toml``."""
    text = resources.files("rtsim.aircraft.xv15").joinpath("data", "protection.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def load_limits() -> Limits:
    """Give the XV-15's limits."""
    numbers = dict(_si(key, value) for key, value in protection_data()["limits"].items() if not isinstance(value, str))
    return Limits(
        torque=TorqueTables(
            cruise=numbers["mast_torque"],
            takeoff=numbers["mast_torque_takeoff"],
            takeoff_nacelle=numbers["takeoff_nacelle_above"],
            takeoff_airspeed=numbers["takeoff_airspeed_below"],
        ),
        sink=SinkTables(
            floor=numbers["sink_rate"],
            slope=math.sin(numbers["sink_angle"]),
            height=numbers["sink_height"],
            time=numbers["sink_time"],
        ),
        **numbers,
    )


def _si(key: str, value: float) -> tuple[str, float]:
    """A number by its name without the unit, SI and radians."""
    for unit, scale in _SCALES.items():
        if key.endswith(unit):
            return key.removesuffix(unit), value * scale
    return key, value


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
