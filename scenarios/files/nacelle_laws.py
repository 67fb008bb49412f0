"""Who sets the nacelle rate: the programme, the built-in automatic control, or a law of the user's own."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, cast

from pydantic import Field

from rtsim.command import Command, NacelleLaw, Sensors
from rtsim.errors import InputError
from rtsim.guests import GuestError, visited
from rtsim.plugins import PluginKind, find_plugin, make_plugin
from rtsim.programme import Programme
from rtsim.strict import Strict
from rtsim.units import deg, kt

if TYPE_CHECKING:
    from rtsim.nacelle.automatic import AutomaticNacelle

NACELLE_PLUGIN = PluginKind(
    noun="a nacelle law",
    option="--nacelle",
    entry_point_group="rtsim.nacelle_laws",
    built_in=("programme", "automatic"),
    method="step(sensors, command, dt)",
    page="rtsim.command.NacelleLaw",
)
"""A nacelle law as plug-in."""
Schedule = Literal["centre-line", "programme", "points"]
NacelleLawFactory = Callable[[], NacelleLaw]


class SchedulePoint(Strict):
    """One of ``automatic.points``: a corner of the schedule."""

    airspeed_kt: Annotated[float, Field(ge=-40.0, le=260.0, allow_inf_nan=False)]
    nacelle_deg: Annotated[float, Field(ge=0.0, le=90.0, allow_inf_nan=False)]


class AutomaticTable(Strict):
    """``[automatic]``: settings of the automatic nacelle control."""

    schedule: Schedule = "centre-line"
    points: Annotated[list[SchedulePoint], Field(max_length=1000)] = []
    rate_deg_s: Annotated[float, Field(ge=0.1, le=12.0, allow_inf_nan=False)] = 7.5
    acceleration_deg_s2: Annotated[float, Field(ge=0.5, le=100.0, allow_inf_nan=False)] = 15.0
    detents: bool = False


@dataclass(frozen=True, slots=True)
class AutomaticSettings:
    """The table in SI and radians, without compiled code."""

    schedule: Schedule = "centre-line"
    """Where the nacelles belong: on the corridor's centre line, on the programme's path, or on the points."""
    points: tuple[tuple[float, float], ...] = ()
    """Corners of the schedule: airspeed [m/s], nacelle angle [rad]."""
    rate: float = deg(7.5)
    """Largest rate [rad/s]."""
    acceleration: float = deg(15.0)
    """Largest change of the rate per second [rad/s^2]."""
    detents: bool = False
    """Pause at the detents."""


def automatic_settings(table: AutomaticTable | None) -> AutomaticSettings:
    """Bring the table to SI.

    Args:
        table: The table; None: the defaults.
    """
    if table is None:
        return AutomaticSettings()
    return AutomaticSettings(
        schedule=table.schedule,
        points=tuple((kt(point.airspeed_kt), deg(point.nacelle_deg)) for point in table.points),
        rate=deg(table.rate_deg_s),
        acceleration=deg(table.acceleration_deg_s2),
        detents=table.detents,
    )


def automatic_problems(table: AutomaticTable | None, nacelle: str, file: str) -> list[InputError]:
    """What contradicts itself in the table.

    Args:
        table: The table, if there is one.
        nacelle: The key ``flight.nacelle``.
    """
    if table is None:
        return []
    if nacelle != "automatic":
        mend = 'set nacelle = "automatic" in [flight], or leave the table out'
        return [InputError("has no effect: another law sets the nacelles", file=file, key="automatic", mend=mend)]
    if (table.schedule == "points") != bool(table.points):
        mend = 'give points with schedule = "points", and only then'
        return [InputError("does not go with the schedule", file=file, key="automatic.points", mend=mend)]
    speeds = [point.airspeed_kt for point in table.points]
    angles = [point.nacelle_deg for point in table.points]
    if table.points and (speeds != sorted(set(speeds)) or angles != sorted(angles, reverse=True) or len(speeds) < 2):
        problem = "needs two or more points whose airspeeds rise and whose nacelle angles do not"
        return [InputError(problem, file=file, key="automatic.points", value=list(zip(speeds, angles, strict=True)))]
    return []


def automatic_nacelle(nacelle: str, settings: AutomaticSettings, programme: Programme) -> AutomaticNacelle | None:
    """The built-in law of a flight.

    Args:
        nacelle: Who sets the nacelle rate.
        settings: The law's settings.
        programme: The flight's programme, for the schedule of that name.

    Returns:
        The law, or None where the nacelles are set by somebody else.

    Raises:
        InputError: The programme's nacelle angle is no function of its airspeed.
    """
    if nacelle != "automatic":
        return None
    from rtsim.nacelle.automatic import AutomaticNacelle, NacelleSchedule, programme_schedule

    if settings.schedule == "points":
        schedule = NacelleSchedule(tuple(v for v, _ in settings.points), tuple(n for _, n in settings.points))
    elif settings.schedule == "programme":
        schedule = programme_schedule(programme)
    else:
        schedule = None  # the centre line of whichever aircraft flies
    return AutomaticNacelle(
        schedule=schedule, rate=settings.rate, acceleration=settings.acceleration, detents=settings.detents
    )


def load_nacelle_law(name: str) -> NacelleLawFactory | None:
    """The plug-in behind a nacelle law's name.

    Args:
        name: ``programme``, ``automatic``, an entry point's name, or ``MODULE:CLASS``; modules are also looked for in
            the current directory.

    Returns:
        Something that makes a fresh law, or None for the two built-in names.

    Raises:
        InputError: There is no such law, it has no ``step`` method, or its module cannot be imported.
    """
    if name in NACELLE_PLUGIN.built_in:
        return None
    target = find_plugin(name, NACELLE_PLUGIN)

    def make() -> NacelleLaw:
        return cast("NacelleLaw", make_plugin(target, name, NACELLE_PLUGIN))

    return make


class NacelleLawGuard:
    """Asks a user's law frame by frame; one that fails is left out from then on, and the flight goes on."""

    def __init__(self, factory: NacelleLawFactory) -> None:
        """Make the law.

        Args:
            factory: Makes it, here and after every reset.
        """
        self._factory = factory
        self._law: NacelleLaw | None = factory()

    def reset(self) -> None:
        """Begin anew with a fresh law."""
        self._law = self._factory()

    def step(self, sensors: Sensors, command: Command, dt: float) -> tuple[Command, str]:
        """Give the command with the law's nacelle rate, and what went wrong, if anything.

        Args:
            command: The pilot's command.
        """
        if self._law is None:
            return command, ""
        try:
            rate = visited(lambda law: float(law.step(sensors, command, dt)), self._law)
        except GuestError as error:
            failure = f"the nacelle law raised {error}"
        else:
            if math.isfinite(rate):
                return dataclasses.replace(command, nacelle_rate=rate), ""
            failure = f"the nacelle law gave a rate that is not finite: {rate}"
        self._law = None
        return command, failure
