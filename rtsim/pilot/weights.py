"""A pilot's settings: one set of weights, thresholds and noises for the whole conversion corridor of an aircraft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rtsim.aircraft.profile import AircraftProfile, Part
from rtsim.units import deg, ft


@dataclass(frozen=True, slots=True)
class DisplaySettings:
    """How one display is weighted and seen."""

    maximum: float
    """Deviation that is just acceptable; the weight is 1 / maximum^2 [the display's unit]."""
    threshold: float
    """Half width of the indifference zone [the display's unit]."""
    attention: float
    """Share of attention, 0..1."""
    noise_ratio: float
    """Observation noise ratio at full attention."""


@dataclass(frozen=True, slots=True)
class PilotSettings:
    """Everything that makes the scheduled pilot besides the aircraft. SI and radians."""

    airspeed: DisplaySettings
    """Airspeed error [m/s]."""
    altitude: DisplaySettings
    """Altitude error [m]."""
    climb_rate: DisplaySettings
    """Climb rate [m/s]."""
    pitch: DisplaySettings
    """Pitch deviation [rad]; same instrument as the pitch rate."""
    pitch_rate: DisplaySettings
    """Pitch-rate deviation [rad/s]."""
    integral_time: float
    """Maximum of an integral over the maximum of its error [s]."""
    integral_noise_ratio: float
    """Observation noise ratio of the integrals, which the pilot keeps in mind and does not read."""
    delay: float
    """Effective delay of both hands [s]."""
    stick_lag: float
    """Neuromotor lag of the stick hand [s]."""
    lever_lag: float
    """Neuromotor lag of the lever hand [s]."""
    motor_noise_ratio: float
    """Motor noise ratio."""
    gust_intensity: float
    """Standard deviation of each gust component reckoned with [m/s]."""
    gust_length: float
    """Turbulence length [m]."""
    gust_least_airspeed: float
    """Airspeed below which the gust filters stay as they are [m/s]."""
    schedule_time: float
    """Time constant of the airspeed that schedules the gains [s]."""
    stick_rate_limit: float
    """Fastest movement of the stick hand [1/s]."""
    lever_rate_limit: float
    """Fastest movement of the lever hand [1/s]."""
    airspeed_proportional: float
    """Outer PI loop: airspeed command per airspeed error [-]."""
    airspeed_integral: float
    """Outer PI loop: airspeed command per integral of airspeed error [1/s]."""
    altitude_proportional: float
    """Outer PI loop: altitude command per altitude error [-]."""
    altitude_integral: float
    """Outer PI loop: altitude command per integral of altitude error [1/s]."""

    @property
    def displays(self) -> tuple[DisplaySettings, ...]:
        """Airspeed, altitude, climb rate, pitch, pitch rate."""
        return (self.airspeed, self.altitude, self.climb_rate, self.pitch, self.pitch_rate)


@dataclass(frozen=True, slots=True)
class LateralPilotSettings:
    """What makes the pilot's lateral half besides the aircraft; the rest it shares with the other. SI and radians."""

    lateral_velocity: DisplaySettings
    """Lateral airspeed [m/s]."""
    roll_rate: DisplaySettings
    """Roll-rate deviation [rad/s]; same instrument as the bank."""
    bank: DisplaySettings
    """Bank deviation [rad]."""
    yaw_rate: DisplaySettings
    """Yaw-rate deviation [rad/s]; same instrument as the heading."""
    heading: DisplaySettings
    """Heading error [rad]."""
    lateral_stick_lag: float
    """Neuromotor lag of the hand on the lateral stick [s]."""
    pedal_lag: float
    """Neuromotor lag of the feet [s]."""
    lateral_stick_rate_limit: float
    """Fastest movement of the lateral stick [1/s]."""
    pedal_rate_limit: float
    """Fastest movement of the pedals [1/s]."""
    span: float
    """Wing span, over which a roll gust reaches [m]."""
    integral_time: float
    integral_noise_ratio: float
    delay: float
    motor_noise_ratio: float
    gust_intensity: float
    gust_length: float
    gust_least_airspeed: float
    schedule_time: float

    @property
    def displays(self) -> tuple[DisplaySettings, ...]:
        """Lateral velocity, roll rate, bank, yaw rate, heading."""
        return (self.lateral_velocity, self.roll_rate, self.bank, self.yaw_rate, self.heading)


_SHARED = ("integral_noise_ratio", "delay", "motor_noise_ratio", "gust_intensity", "gust_length",
           "gust_least_airspeed", "schedule_time")  # fmt: skip
_LATERAL_DISPLAYS = (
    ("lateral_velocity", "m_s"), ("roll_rate", "deg_s"), ("bank", "deg"), ("yaw_rate", "deg_s"), ("heading", "deg"),
)  # fmt: skip
_LATERAL_NUMBERS = (
    ("lateral_stick_lag", "s", 0.01, 2.0),
    ("pedal_lag", "s", 0.01, 2.0),
    ("lateral_stick_rate_limit", "per_s", 0.01, 100.0),
    ("pedal_rate_limit", "per_s", 0.01, 100.0),
    ("integral_time", "s", 0.1, 1000.0),
)
_DISPLAYS = (("airspeed", "m_s"), ("altitude", "m"), ("climb_rate", "m_s"), ("pitch", "deg"), ("pitch_rate", "deg_s"))
_NUMBERS = (
    ("integral_time", "s", 0.1, 1000.0),
    ("integral_noise_ratio", "", 0.0, 1.0),
    ("delay", "s", 0.01, 1.0),
    ("stick_lag", "s", 0.01, 2.0),
    ("lever_lag", "s", 0.01, 2.0),
    ("motor_noise_ratio", "", 0.0, 1.0),
    ("gust_intensity", "ft_s", 0.01, 100.0),
    ("gust_length", "ft", 1.0, 100_000.0),
    ("gust_least_airspeed", "m_s", 0.1, 200.0),
    ("schedule_time", "s", 0.01, 100.0),
    ("stick_rate_limit", "per_s", 0.01, 100.0),
    ("lever_rate_limit", "per_s", 0.01, 100.0),
    ("airspeed_proportional", "", 0.0, 100.0),
    ("airspeed_integral", "per_s", 0.0, 100.0),
    ("altitude_proportional", "", 0.0, 100.0),
    ("altitude_integral", "per_s", 0.0, 100.0),
)


def pilot_settings(profile: AircraftProfile) -> PilotSettings:
    """The settings of an aircraft's pilot.

    Raises:
        InputError: A value is missing or out of range.
    """
    part = profile.pilot
    displays: dict[str, Any] = {name: _display(part.table(name), unit) for name, unit in _DISPLAYS}
    numbers: dict[str, Any] = {}
    for name, unit, low, high in _NUMBERS:
        value = part.number(f"{name}_{unit}" if unit else name, low=low, high=high)
        numbers[name] = ft(value) if unit.startswith("ft") else value
    return PilotSettings(**displays, **numbers)


def _display(part: Part, unit: str) -> DisplaySettings:
    scale = deg(1.0) if unit.startswith("deg") else 1.0
    return DisplaySettings(
        maximum=part.number(f"maximum_{unit}", low=1e-6, high=1000.0) * scale,
        threshold=part.number(f"threshold_{unit}", low=0.0, high=1000.0) * scale,
        attention=part.number("attention", low=0.001, high=1.0),
        noise_ratio=part.number("noise_ratio", low=0.0, high=1.0),
    )


def lateral_pilot_settings(profile: AircraftProfile) -> LateralPilotSettings:
    """The settings of the lateral half of an aircraft's pilot.

    Raises:
        InputError: A value is missing or out of range.
    """
    part, shared = profile.pilot.table("lateral"), pilot_settings(profile)
    displays: dict[str, Any] = {name: _display(part.table(name), unit) for name, unit in _LATERAL_DISPLAYS}
    numbers: dict[str, Any] = {
        name: part.number(f"{name}_{unit}", low=low, high=high) for name, unit, low, high in _LATERAL_NUMBERS
    }
    numbers["span"] = ft(profile.dimensions.number("span_ft", low=1.0, high=1000.0))
    return LateralPilotSettings(**displays, **numbers, **{name: getattr(shared, name) for name in _SHARED})
