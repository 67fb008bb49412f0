"""Automatic nacelle control in Python: its settings, its schedules, and the law as a plug-in of the user's own kind.

The simulation calls the kernels; :class:`ScheduledNacelle` wraps the same kernels behind
:class:`rtsim.command.NacelleLaw`, to be flown by ``MODULE:CLASS`` or taken as a pattern.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.aircraft.profile import AircraftProfile
from rtsim.arrays import FloatArray
from rtsim.command import Command, Sensors
from rtsim.corridor.boundaries import load_corridor
from rtsim.errors import InputError
from rtsim.nacelle.automatic_kernels import (
    AUTOMATIC_STATE_SIZE,
    AutomaticTables,
    automatic_advance,
    automatic_rate,
)
from rtsim.nacelle.switch import load_nacelle_tables
from rtsim.programme import Programme
from rtsim.units import deg, to_deg

NOMINAL_RATE = deg(7.5)
"""Rate of the XV-15's conversion actuators [rad/s] (TM 81244)."""
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class NacelleSchedule:
    """Nacelle angle over airspeed."""

    airspeed: tuple[float, ...]
    """Airspeeds of the corners, strictly ascending [m/s]."""
    nacelle: tuple[float, ...]
    """Nacelle angles there, nowhere rising [rad]."""

    def __post_init__(self) -> None:
        """Refuse what is no function of airspeed (:class:`InputError`)."""
        if len(self.airspeed) != len(self.nacelle) or len(self.airspeed) < 2:
            raise InputError("needs as many nacelle angles as airspeeds, at least two", key="nacelle schedule")
        if not np.isfinite([*self.airspeed, *self.nacelle]).all():
            raise InputError("holds a value that is not a number", key="nacelle schedule")
        if np.any(np.diff(self.airspeed) <= 0.0):
            raise InputError("its airspeeds must rise", key="nacelle schedule", value=list(self.airspeed))
        if np.any(np.diff(self.nacelle) > _ROUNDING):
            angles = [round(to_deg(angle), 3) for angle in self.nacelle]
            raise InputError("its nacelle angles must not rise with the airspeed", key="nacelle schedule", value=angles)

    def at(self, airspeed: float) -> float:
        """Nacelle angle at an airspeed [rad]; constant beyond the ends."""
        return float(np.interp(airspeed, self.airspeed, self.nacelle))


def centre_line_schedule(
    corridor: str = "design", *, step_deg: float = 5.0, profile: AircraftProfile | None = None
) -> NacelleSchedule:
    """The centre line of a corridor, from helicopter to airplane mode.

    Args:
        corridor: Name of the corridor.
        step_deg: Distance of the corners in nacelle angle [deg].
    """
    centre = load_corridor(corridor, profile).centre_speed
    corners: list[tuple[float, float]] = []
    for degrees in np.arange(90.0, -step_deg / 2.0, -step_deg):
        angle = deg(max(float(degrees), 0.0))
        airspeed = float(centre(angle))
        if corners and airspeed <= corners[-1][0]:
            continue
        corners.append((airspeed, angle))
    return NacelleSchedule(tuple(v for v, _ in corners), tuple(n for _, n in corners))


def programme_schedule(programme: Programme) -> NacelleSchedule:
    """The path of a programme as a schedule: where it is in airspeed says where the nacelles belong.

    Args:
        programme: A conversion or a reconversion whose nacelle angle follows from its airspeed.

    Raises:
        InputError: The programme tilts the nacelles at a constant airspeed, or back and forth.
    """
    airspeed, nacelle = programme.airspeed, programme.nacelle_angle
    if airspeed[-1] < airspeed[0]:
        airspeed, nacelle = airspeed[::-1], nacelle[::-1]
    corners = [(float(airspeed[0]), float(nacelle[0]))]
    for speed, angle in zip(airspeed[1:].tolist(), nacelle[1:].tolist(), strict=True):
        if abs(speed - corners[-1][0]) <= _ROUNDING and abs(angle - corners[-1][1]) <= _ROUNDING:
            continue
        corners.append((speed, angle))
    return NacelleSchedule(tuple(v for v, _ in corners), tuple(n for _, n in corners))


@dataclass(frozen=True, slots=True)
class AutomaticNacelle:
    """Settings of the automatic nacelle control. SI and radians."""

    schedule: NacelleSchedule | None = None
    """Nacelle angle over airspeed; None: the centre line of the aircraft's design corridor."""
    rate: float = NOMINAL_RATE
    """Largest rate [rad/s], up to what the aircraft's actuators may be assigned."""
    acceleration: float = deg(15.0)
    """Largest change of the rate per second [rad/s^2]."""
    detents: bool = False
    """Pause at the detents (75 and 50 deg)."""
    gain: float = 1.5
    """Rate per angle still to go [1/s]."""
    correction: float = 0.5
    """How fast the filtered airspeed is drawn to the indicated one [1/s]; below it gusts pass, above it they do not."""
    lead: float = 2.0 / 3.0
    """How far ahead the schedule is read [s]: the lag of the critically damped 3 rad/s actuator in a ramp."""
    detent_zone: float = deg(3.0)
    """Distance of the scheduled angle from a detent within which the nacelles pause [rad]."""
    detent_gain: float = 5.0
    """Gain where there are detents [1/s]: the nacelles must arrive before the schedule has left the zone."""

    def __post_init__(self) -> None:
        """Refuse what is not positive (:class:`InputError`)."""
        for name in ("rate", "acceleration", "gain", "correction", "detent_gain"):
            if not (getattr(self, name) > 0.0 and np.isfinite(getattr(self, name))):
                raise InputError("must be positive", key=f"nacelle {name}", value=getattr(self, name))

    def tables(self, profile: AircraftProfile | None = None) -> AutomaticTables:
        """The settings as the kernels take them.

        Args:
            profile: The aircraft, whose detents count and whose centre line is followed where no schedule is given;
                None: the XV-15.
        """
        nacelle = load_nacelle_tables(profile)
        if self.rate > nacelle.assigned_rate + _ROUNDING:
            raise InputError(
                "is out of range",
                key="nacelle rate",
                value=round(to_deg(self.rate), 6),
                allowed=f"more than 0, up to {to_deg(nacelle.assigned_rate):g} deg/s",
            )
        detents = nacelle.detents if self.detents else np.zeros(0)
        schedule = centre_line_schedule(profile=profile) if self.schedule is None else self.schedule
        return AutomaticTables(
            active=1,
            airspeed=_array(schedule.airspeed),
            nacelle=_array(schedule.nacelle),
            rate=float(self.rate),
            acceleration=float(self.acceleration),
            gain=float(self.detent_gain if self.detents else self.gain),
            correction=float(self.correction),
            lead=float(self.lead),
            detents=_array(tuple(float(angle) for angle in detents)),
            detent_zone=float(self.detent_zone),
        )


def inactive_tables() -> AutomaticTables:
    """Tables of a flight whose nacelles follow its programme."""
    return AutomaticNacelle(NacelleSchedule((0.0, 1.0), (deg(90.0), 0.0))).tables()._replace(active=0)


class ScheduledNacelle:
    """The automatic nacelle control as a plug-in law; a pattern for laws of your own."""

    def __init__(self, settings: AutomaticNacelle | None = None) -> None:
        """Begin at rest.

        Args:
            settings: The law's settings; None takes the centre line at the nominal rate.
        """
        self.settings = AutomaticNacelle() if settings is None else settings
        self._tables = self.settings.tables()
        self._state: FloatArray = np.zeros(AUTOMATIC_STATE_SIZE)
        # The sensors show the nacelles, which lag behind what they were commanded: the law keeps count of that itself.
        self._command_angle: float | None = None

    def step(self, sensors: Sensors, command: Command, dt: float) -> float:  # noqa: ARG002 - part of the interface
        """Give this frame's nacelle rate [rad/s].

        Args:
            command: The pilot's command of this frame; not used.
        """
        if self._command_angle is None or not sensors.nacelle_ok:
            self._command_angle = sensors.nacelle_angle
        seen = (sensors.airspeed, sensors.airspeed_rate)
        rate = float(automatic_rate(self._tables, self._state, *seen, self._command_angle, dt))
        automatic_advance(self._tables, self._state, *seen, rate, dt)
        self._command_angle = min(max(self._command_angle + rate * dt, 0.0), deg(90.0))
        return rate


def _array(values: tuple[float, ...]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


__all__ = [
    "NOMINAL_RATE",
    "AutomaticNacelle",
    "NacelleSchedule",
    "ScheduledNacelle",
    "centre_line_schedule",
    "inactive_tables",
    "programme_schedule",
]
