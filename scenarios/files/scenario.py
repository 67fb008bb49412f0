"""A scenario as the rest of the program sees it: checked, in SI, with times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from rtsim.atmosphere import AirSpecification
from rtsim.faults import Fault
from rtsim.loop.script import Pulse
from rtsim.programme import Programme, ProgrammePoint
from rtsim.units import deg, kt
from scenarios.files.nacelle_laws import AutomaticSettings
from scenarios.files.trial import Trial

PlantName = Literal["lpv", "lpv-plain", "nonlinear"]
OuterLoop = Literal["integrators", "pi"]
CorridorName = Literal["design", "flight", "model"]
PASSIVE_LAWS = frozenset({"off", "monitor"})
"""Protection that changes no command."""
PilotMode = Literal["mocm", "external", "hold"]
AidName = Literal["rate_damping", "attitude_retention", "altitude_hold", "airspeed_hold", "trim_bias"]
"""The aids of ``rtsim.aids`` that act on the controls, named here so that reading a file loads no compiled code."""

START_CONDITIONS: dict[str, tuple[float, float]] = {
    "hover": (0.0, deg(90.0)),
    "conversion": (kt(80.0), deg(75.0)),
    "cruise": (kt(170.0), 0.0),
}
"""Airspeed [m/s] and nacelle angle [rad] of the named starts; ``conversion`` is a corner of the paper's Table 1."""
DEFAULT_ALTITUDE = 100.0
"""Altitude of a start that does not give one [m]."""


@dataclass(frozen=True, slots=True)
class ScenarioEvent:
    """Something a scenario makes happen."""

    time: float
    """When, from the start [s]; it acts from the first frame at or after this time."""
    pilot: PilotMode
    """Who holds the sticks from then on."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """A metric and the range it must lie in."""

    name: str
    """What is expected, in words."""
    metric: str
    """Dotted name of the metric, one of ``rtsim.measures.metrics.METRIC_NAMES``; its unit is part of it."""
    minimum: float | None
    """Smallest value that holds."""
    maximum: float | None
    """Largest value that holds."""

    @property
    def limit(self) -> float | list[float]:
        """The limit as reported: one number, or ``[minimum, maximum]``."""
        if self.minimum is not None and self.maximum is not None:
            return [self.minimum, self.maximum]
        limit = self.maximum if self.minimum is None else self.minimum
        assert limit is not None  # the loader refuses a clause without a limit
        return limit

    def holds(self, value: float | None) -> bool:
        """Whether a measured value meets the expectation; a metric without value does not.

        Args:
            value: The metric as measured, in the unit of its name.
        """
        if value is None:
            return False
        low = self.minimum is None or value >= self.minimum
        return low and (self.maximum is None or value <= self.maximum)


@dataclass(frozen=True, slots=True)
class Scenario:
    """A flight to be flown: SI units and radians."""

    name: str
    title: str
    description: str
    programme: Programme
    """What the flight is asked to do."""
    duration: float
    """Length of the flight [s]; beyond the programme its last point is held."""
    start: ProgrammePoint
    """Trimmed condition at frame 0."""
    plant: PlantName
    outer_loop: OuterLoop
    pilot: str
    """``mocm``, an entry point's name, or ``MODULE:CLASS``."""
    corridor: CorridorName | None
    """Boundaries to watch; None chooses by the protection."""
    protection: str
    """Protection laws by name, in the order in which they act, separated by commas."""
    rate_hz: int
    seed: int
    wind: float
    """Steady wind along the flight [m/s], tailwind positive."""
    pilot_noise: bool
    """Whether the MOCM's motor and observation noise is on."""
    aids: tuple[AidName, ...]
    """Pilot aids on at the start; they act on every pilot but the MOCM."""
    automatic_flaps: bool
    """Whether the flaps follow their schedule at the start, whoever flies."""
    governor: bool
    """Whether the governor holds the rotor speed at the start, whoever flies."""
    air: AirSpecification
    """Gusts and turbulence."""
    faults: tuple[Fault, ...]
    """Failures and their times."""
    events: tuple[ScenarioEvent, ...]
    expectations: tuple[Expectation, ...]
    source: str
    """Text of the file it came from; empty for scenarios made in Python."""
    file: str
    """Where it came from, as shown in messages."""
    database: str = ""
    """LPV database that is flown, a file; empty: the shipped XV-15."""
    nacelle: str = "programme"
    """Who sets the nacelle rate: ``programme`` (the pilot, as the programme asks), ``automatic``, or MODULE:CLASS."""
    automatic: AutomaticSettings = field(default_factory=AutomaticSettings)
    """Settings of the automatic nacelle control."""
    pulses: tuple[Pulse, ...] = ()
    """What scripted hands do to the controls besides the pilot."""
    trial: Trial | None = None
    """What makes it a test of envelope protection; None where it is none."""

    @property
    def corridor_name(self) -> CorridorName:
        """The corridor in force: ``flight`` with a protection that acts, else ``design``."""
        if self.corridor is not None:
            return self.corridor
        return "design" if self.protection in PASSIVE_LAWS else "flight"
