"""The XV-15 pilot's settings: one set of weights, thresholds and noises for the whole conversion corridor.

Maxima, thresholds and attention are engineering values for a longitudinal instrument task (docs/pilot.md); noise ratios
are the classic -20 dB and -25 dB, thresholds of pitch and pitch rate those of NASA CR-177943.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    noise_ratio: float = 0.01
    """Observation noise ratio at full attention (-20 dB)."""


@dataclass(frozen=True, slots=True)
class PilotSettings:
    """Everything that makes the scheduled pilot besides the aircraft. SI and radians."""

    airspeed: DisplaySettings = DisplaySettings(maximum=2.5, threshold=0.25, attention=0.15)
    """Airspeed error [m/s]."""
    altitude: DisplaySettings = DisplaySettings(maximum=5.0, threshold=0.5, attention=0.20)
    """Altitude error [m]."""
    climb_rate: DisplaySettings = DisplaySettings(maximum=1.0, threshold=0.15, attention=0.15)
    """Climb rate [m/s]."""
    pitch: DisplaySettings = DisplaySettings(maximum=deg(5.0), threshold=deg(0.1), attention=0.50)
    """Pitch deviation [rad]; same instrument as the pitch rate."""
    pitch_rate: DisplaySettings = DisplaySettings(maximum=deg(5.0), threshold=deg(0.18), attention=0.50)
    """Pitch-rate deviation [rad/s]."""
    integral_time: float = 10.0
    """Maximum of an integral over the maximum of its error [s]."""
    integral_noise_ratio: float = 1e-4
    """Observation noise ratio of the integrals, which the pilot keeps in mind and does not read."""
    delay: float = 0.17
    """Effective delay of both hands [s]."""
    stick_lag: float = 0.1
    """Neuromotor lag of the stick hand [s]."""
    lever_lag: float = 0.2
    """Neuromotor lag of the lever hand [s]."""
    motor_noise_ratio: float = 10.0**-2.5
    """Motor noise ratio (-25 dB)."""
    gust_intensity: float = ft(5.06)
    """Standard deviation of each gust component reckoned with [m/s]."""
    gust_length: float = ft(1000.0)
    """Turbulence length [m]."""
    gust_least_airspeed: float = 15.433
    """Airspeed below which the gust filters stay as they are (30 kn) [m/s]."""
    schedule_time: float = 0.3
    """Time constant of the airspeed that schedules the gains [s]."""
    stick_rate_limit: float = 10.0 / 4.8
    """Fastest movement of the stick hand, 10 in/s [1/s]."""
    lever_rate_limit: float = 0.6
    """Fastest movement of the lever hand [1/s]."""
    airspeed_proportional: float = 1.0
    """Outer PI loop: airspeed command per airspeed error [-]."""
    airspeed_integral: float = 0.1
    """Outer PI loop: airspeed command per integral of airspeed error [1/s]."""
    altitude_proportional: float = 1.0
    """Outer PI loop: altitude command per altitude error [-]."""
    altitude_integral: float = 0.2
    """Outer PI loop: altitude command per integral of altitude error [1/s]."""

    @property
    def displays(self) -> tuple[DisplaySettings, ...]:
        """Airspeed, altitude, climb rate, pitch, pitch rate."""
        return (self.airspeed, self.altitude, self.climb_rate, self.pitch, self.pitch_rate)
