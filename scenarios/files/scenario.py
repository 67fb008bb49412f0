"""A scenario as the rest of the program sees it: checked, in SI, with times."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from rtsim.atmosphere.specification import AirSpecification
from rtsim.choices import PilotMode
from rtsim.faults.fault import Fault
from rtsim.loop.options import FlightOptions
from rtsim.loop.script import Pulse
from rtsim.programme import Programme, ProgrammePoint
from rtsim.units import deg, kt
from scenarios.files.expectation import Expectation
from scenarios.files.nacelle_laws import AutomaticSettings
from scenarios.files.trial import Trial

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
    options: FlightOptions
    """Who flies what."""
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
    automatic: AutomaticSettings = field(default_factory=AutomaticSettings)
    """Settings of the automatic nacelle control."""
    pulses: tuple[Pulse, ...] = ()
    """What scripted hands do to the controls besides the pilot."""
    reaction: float | None = None
    """A pilot who yields: how long a warning lasts before he gives up his plan [s]; None: he never does."""
    trial: Trial | None = None
    """What makes it a test of envelope protection; None where it is none."""

    def with_options(self, **changes: Any) -> Scenario:
        """The scenario with other options.

        Args:
            changes: Values by field of :class:`~rtsim.loop.options.FlightOptions`, SI.
        """
        return dataclasses.replace(self, options=self.options.changed(changes))
