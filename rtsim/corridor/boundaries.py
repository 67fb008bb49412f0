"""The conversion corridor: boundaries with their sources, signed margins, centre line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rtsim.aircraft.profile import AircraftProfile, Part, xv15_profile
from rtsim.arrays import FloatArray
from rtsim.command import Margins
from rtsim.errors import InputError
from rtsim.units import deg, kt

if TYPE_CHECKING:
    from rtsim.corridor.corridor_kernels import CorridorTables

LEVEL_NAMES = ("clear", "caution", "warning", "exceedance")
"""Words for the levels 0 to 3 of ``corridor_level``."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """One side of the corridor: a polyline of airspeed over nacelle angle."""

    nacelle: FloatArray
    """Nacelle angles of the corners, ascending, shape (n,) [rad]."""
    speed: FloatArray
    """Airspeeds of the corners, shape (n,) [m/s]; nowhere rising with the nacelle angle."""
    kind: str
    """What physically limits here."""
    source: str
    """Publication and figure."""

    def __post_init__(self) -> None:
        nacelle, speed = self.nacelle, self.speed
        if nacelle.ndim != 1 or nacelle.shape != speed.shape or nacelle.size < 2:
            raise InputError("a boundary needs as many speeds as nacelle angles, at least two", key="speed_kn")
        if not (np.all(np.isfinite(nacelle)) and np.all(np.isfinite(speed))):
            raise InputError("a boundary holds a value that is not a number", key="speed_kn")
        if np.any(np.diff(nacelle) <= 0.0):
            raise InputError("the nacelle angles of a boundary must fall strictly", key="nacelle_deg")
        if np.any(np.diff(speed) > 0.0):
            raise InputError("the speeds of a boundary must not fall as the nacelle angle falls", key="speed_kn")

    def at(self, nacelle_angle: float | FloatArray) -> float | FloatArray:
        """Airspeed of the boundary [m/s]; constant beyond its ends.

        Args:
            nacelle_angle: Nacelle angle, one value or an array of any shape [rad].
        """
        speed = np.interp(nacelle_angle, self.nacelle, self.speed)
        return float(speed) if np.ndim(speed) == 0 else speed


@dataclass(frozen=True, slots=True)
class Levels:
    """When the corridor cautions, warns and counts an exceedance."""

    threshold: FloatArray
    """Margins below which caution, warning and exceedance begin, shape (3,), falling [m/s]."""
    hysteresis: float
    """How far above its threshold the margin must rise before a level ends [m/s]."""
    rise_time: float
    """How long the margin must be below a threshold before the level begins [s]."""
    fall_time: float
    """How long the margin must be above threshold + hysteresis before the level ends [s]."""


@dataclass(frozen=True, slots=True)
class Turning:
    """How far a turn moves the sides of a corridor: its load factor raises the stall and the mast torque."""

    nacelle: FloatArray
    """Nacelle angles, ascending, shape (n,) [rad]."""
    low: FloatArray
    """What the low-speed side gains for each unit of load factor above 1, shape (n,) [m/s]."""
    high: FloatArray
    """The same of the high-speed side off the downstop, negative or 0, shape (n,) [m/s]."""


STRAIGHT = Turning(np.array([0.0, 1.0]), np.zeros(2), np.zeros(2))
"""Sides that a turn does not move: those of an aircraft that does not turn, and of a chart by itself."""


@dataclass(frozen=True, slots=True)
class Corridor:
    """A conversion corridor: the airspeeds that each nacelle angle allows."""

    name: str
    """Name by which it is chosen."""
    title: str
    """Title for plots."""
    low: Boundary
    """Low-speed side."""
    high: Boundary
    """High-speed side off the downstop."""
    downstop_nacelle: float
    """At and below this angle the nacelles rest on the airplane-mode stop [rad]."""
    downstop_speed: float
    """High-speed side on the downstop [m/s]."""
    levels: Levels
    """Warning levels of its margins."""
    turning: Turning = STRAIGHT
    """What a turn changes; the chart is that of straight flight."""

    def in_true_airspeed(self, factor: float) -> Corridor:
        """The same corridor for true airspeeds: the charts are in calibrated airspeed.

        Args:
            factor: True airspeed over calibrated airspeed in the air that is flown in.
        """
        if factor == 1.0:
            return self
        return replace(
            self,
            low=replace(self.low, speed=self.low.speed * factor),
            high=replace(self.high, speed=self.high.speed * factor),
            downstop_speed=self.downstop_speed * factor,
        )

    def low_speed(self, nacelle_angle: float | FloatArray, load_factor: float = 1.0) -> float | FloatArray:
        """Lowest allowed airspeed, signed [m/s].

        Args:
            nacelle_angle: Nacelle angle, one value or an array [rad].
            load_factor: That of a level turn.
        """
        moved = np.interp(nacelle_angle, self.turning.nacelle, self.turning.low)
        speed = self.low.at(nacelle_angle) + (load_factor - 1.0) * moved
        return float(speed) if np.ndim(speed) == 0 else np.asarray(speed)

    def high_speed(self, nacelle_angle: float | FloatArray, load_factor: float = 1.0) -> float | FloatArray:
        """Highest allowed airspeed [m/s]; steps up on the downstop.

        Args:
            nacelle_angle: Nacelle angle, one value or an array [rad].
            load_factor: That of a level turn.
        """
        on_downstop = np.asarray(nacelle_angle) <= self.downstop_nacelle
        moved = np.interp(nacelle_angle, self.turning.nacelle, self.turning.high)
        off_it = self.high.at(nacelle_angle) + (load_factor - 1.0) * moved
        speed = np.where(on_downstop, self.downstop_speed, off_it)
        return float(speed) if speed.ndim == 0 else speed

    def centre_speed(self, nacelle_angle: float | FloatArray) -> float | FloatArray:
        """Airspeed midway between the boundaries for flight in conversion [m/s].

        Rearward speeds and the higher limit on the downstop are left out of the middle: the line runs from half the
        high-speed limit in helicopter mode to midway between stall and flap limit in airplane mode.

        Args:
            nacelle_angle: Nacelle angle, one value or an array [rad].
        """
        speed = 0.5 * (np.maximum(self.low.at(nacelle_angle), 0.0) + self.high.at(nacelle_angle))
        return float(speed) if np.ndim(speed) == 0 else speed

    def margins(self, airspeed: float, nacelle_angle: float, bank: float = 0.0) -> Margins:
        """Signed distances to the boundaries, positive inside.

        The nacelle margins are travels at fixed airspeed to the first angle that violates a boundary, or to the end of
        the travel (0 and 95 deg) where none does. Outside, the one towards the violated boundary is negative: that
        much travel the other way re-enters. Where no nacelle angle would do, both are minus the whole travel.

        Args:
            bank: Bank angle of the turn [rad]; its load factor moves the sides.
        """
        from rtsim.corridor.corridor_kernels import MARGIN_COUNT, corridor_margins, turn_excess

        out = np.empty(MARGIN_COUNT)
        corridor_margins(self.tables(), airspeed, nacelle_angle, turn_excess(bank), out)
        return Margins(low=out[0].item(), high=out[1].item(), nacelle_forward=out[2].item(), nacelle_aft=out[3].item())

    def inside(self, airspeed: float, nacelle_angle: float) -> bool:
        """Tell whether a point lies inside or on a boundary."""
        return bool(self.low_speed(nacelle_angle) <= airspeed <= self.high_speed(nacelle_angle))

    def tables(self) -> CorridorTables:
        """Give the ``CorridorTables`` of the compiled kernels."""
        # Imported here: reading boundaries must not cost the start of numba.
        from rtsim.corridor.corridor_kernels import CorridorTables

        return CorridorTables(
            low_nacelle=self.low.nacelle,
            low_speed=self.low.speed,
            high_nacelle=self.high.nacelle,
            high_speed=self.high.speed,
            downstop_nacelle=self.downstop_nacelle,
            downstop_speed=self.downstop_speed,
            turn_nacelle=self.turning.nacelle,
            turn_low=self.turning.low,
            turn_high=self.turning.high,
            level_threshold=self.levels.threshold,
            level_hysteresis=self.levels.hysteresis,
            level_rise_time=self.levels.rise_time,
            level_fall_time=self.levels.fall_time,
        )


@lru_cache(maxsize=16)
def load_corridor(name: str = "design", profile: AircraftProfile | None = None) -> Corridor:
    """Load an aircraft's corridor.

    Args:
        name: ``design`` (XV-15: NASA TM X-62407 attitude and stall limits) or ``flight`` (NASA TM 81244 power-on
            stall); the XV-15's share the high-speed side.

    Raises:
        InputError: There is no such corridor, or a value is missing or out of range.
    """
    part = (xv15_profile() if profile is None else profile).corridor
    named, levels, downstop = part.table("corridor"), part.table("levels"), part.table("downstop")
    if not named.has(name):
        raise InputError("no such corridor", key="corridor", value=name, allowed=", ".join(named.data))
    entry = named.table(name)
    sources = part.table("sources").data if part.has("sources") else {}
    threshold = levels.numbers("threshold_kn", low=-100.0, high=200.0, count=3)
    return Corridor(
        name=name,
        title=entry.text("title"),
        low=_boundary(part.table("low").table(entry.text("low")), sources),
        high=_boundary(part.table("high").table(entry.text("high")), sources),
        downstop_nacelle=deg(downstop.number("nacelle_deg", low=0.0, high=10.0)),
        downstop_speed=kt(downstop.number("high_kn", low=1.0, high=600.0)),
        levels=Levels(
            threshold=_read_only([kt(value) for value in threshold]),
            hysteresis=kt(levels.number("hysteresis_kn", low=0.0, high=50.0)),
            rise_time=levels.number("rise_s", low=0.0, high=60.0),
            fall_time=levels.number("fall_s", low=0.0, high=60.0),
        ),
    )


def _boundary(entry: Part, sources: Mapping[str, str]) -> Boundary:
    source = entry.text("source")
    for code, text in sources.items():
        if code in source:
            source += f" [{code}: {text}]"
    nacelle = entry.numbers("nacelle_deg", low=0.0, high=95.0)
    speed = entry.numbers("speed_kn", low=-200.0, high=600.0, count=len(nacelle))
    try:
        return Boundary(
            nacelle=_read_only([deg(value) for value in reversed(nacelle)]),
            speed=_read_only([kt(value) for value in reversed(speed)]),
            kind=entry.text("kind"),
            source=source,
        )
    except InputError as error:
        raise InputError(error.problem, file=entry.file, key=f"{entry.name}.{error.key}") from None


def _read_only(values: list[float]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array
