"""Failures as data: what breaks, when, how badly, and whether it mends. Loads no compiled code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from rtsim.aircraft.profile import AircraftProfile, xv15_profile
from rtsim.errors import InputError
from rtsim.units import DEGREE, HORSEPOWER, KNOT

FaultKind = Literal[
    "nacelle-jammed",
    "nacelle-slow",
    "actuator-stuck",
    "actuator-slow",
    "actuator-hard-over",
    "airspeed-bias",
    "airspeed-frozen",
    "engine-limit",
    "control-jammed",
]
Actuator = Literal[
    "collective",
    "cyclic",
    "elevator",
    "collective-right",
    "collective-left",
    "cyclic-right",
    "cyclic-left",
    "aileron",
    "rudder",
]
Control = Literal["stick", "lever", "lateral-stick", "pedal"]
Stop = Literal["low", "high"]
EngineRating = Literal["contingency", "takeoff", "military", "normal"]

ACTUATORS: tuple[Actuator, ...] = get_args(Actuator)
"""Actuators that can fail, in the order of the kernels: those that act on both sides alike first."""
CONTROLS: tuple[Control, ...] = get_args(Control)
"""Controls in the cockpit that can jam."""
_LATERAL = {*ACTUATORS[3:], "lateral-stick", "pedal"}
LARGEST_POWER = 1e7
"""Largest power left to a failing engine [W]; what the aircraft's engine gives at most counts besides."""


def engine_rating(profile: AircraftProfile, rating: EngineRating) -> float:
    """Power of one engine [W].

    Args:
        rating: The rating.

    Raises:
        InputError: The profile does not say, or the value is out of range.
    """
    return profile.systems.table("engine").number(f"{rating}_shp", low=1.0, high=1e5) * HORSEPOWER


def transmission_efficiency(profile: AircraftProfile) -> float:
    """Shaft power of the rotors over engine power.

    Raises:
        InputError: The value is missing or out of range.
    """
    return profile.systems.table("engine").number("transmission_efficiency", low=0.1, high=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One failure. SI and radians; each kind takes exactly the fields that belong to it."""

    kind: FaultKind
    """What fails."""
    start: float
    """When; it acts from the first frame at or after this time [s]."""
    end: float | None = None
    """When it mends [s]; None: never."""
    actuator: Actuator | None = None
    """Which actuator (``actuator-...``)."""
    control: Control | None = None
    """Which control in the cockpit stands where it last was (``control-jammed``), whoever moves it."""
    rate: float | None = None
    """Fastest motion left (``nacelle-slow``, ``actuator-slow``), or the rate of an ``actuator-hard-over`` [rad/s]."""
    stop: Stop | None = None
    """End an ``actuator-hard-over`` runs to: ``low`` is the smallest angle, ``high`` the largest."""
    bias: float | None = None
    """What ``airspeed-bias`` adds to the indicated airspeed [m/s]."""
    power: float | None = None
    """Power the failing engine still gives with ``engine-limit``, 0 for none [W]."""
    other_engine: EngineRating = "contingency"
    """Rating the other engine is run at with ``engine-limit``."""

    def __post_init__(self) -> None:
        """Refuse what is out of range, missing or without meaning (:class:`InputError`)."""
        _choice("kind", self.kind, get_args(FaultKind))
        _within("start", self.start, 0.0, 36_000.0, "s")
        if self.end is not None and not (math.isfinite(self.end) and self.end > self.start):
            raise InputError("is not after start", key="end", value=self.end, allowed=f"above {self.start:g} s")
        _choice("other_engine", self.other_engine, get_args(EngineRating))
        needed = {
            "actuator": self.kind.startswith("actuator"),
            "control": self.kind == "control-jammed",
            "rate": self.kind in {"nacelle-slow", "actuator-slow"},
            "stop": self.kind == "actuator-hard-over",
            "bias": self.kind == "airspeed-bias",
            "power": self.kind == "engine-limit",
        }
        for key, is_needed in needed.items():
            given = getattr(self, key) is not None
            if is_needed and not given:
                raise InputError(f"is missing for {self.kind}", key=key, mend="add it")
            if given and not is_needed and not (key == "rate" and self.kind == "actuator-hard-over"):
                raise InputError(f"has no meaning for {self.kind}", key=key, mend="leave it out")
        self._check_values()

    def _check_values(self) -> None:
        if self.actuator is not None:
            _choice("actuator", self.actuator, ACTUATORS)
        if self.control is not None:
            _choice("control", self.control, CONTROLS)
        if self.stop is not None:
            _choice("stop", self.stop, ("low", "high"))
        if self.rate is not None:
            smallest = 0.1 * DEGREE if self.kind == "actuator-hard-over" else 0.0
            _within("rate", self.rate, smallest, 200.0 * DEGREE, "rad/s")
        if self.bias is not None:
            _within("bias", self.bias, -100.0 * KNOT, 100.0 * KNOT, "m/s")
        if self.power is not None:
            _within("power", self.power, 0.0, LARGEST_POWER, "W")

    @property
    def name(self) -> str:
        """The failure in one word, as in the event log: ``cyclic-stuck``, ``nacelle-jammed``."""
        part = self.actuator or self.control
        return self.kind if part is None else f"{part}-{self.kind.partition('-')[2]}"

    @property
    def leaves_symmetry(self) -> bool:
        """Whether it acts on what moves the aircraft out of its plane of symmetry."""
        return bool({self.actuator, self.control} & _LATERAL)

    def size(self, profile: AircraftProfile | None = None) -> float:
        """Its size: rate [rad/s], bias [m/s], shaft power available [W], -1 or 1 for a stop; 0 where there is none.

        Args:
            profile: The aircraft, whose other engine counts; None: the XV-15.

        Raises:
            InputError: The failing engine would give more than a sound one.
        """
        if self.stop is not None:
            return 1.0 if self.stop == "high" else -1.0
        if self.power is not None:
            aircraft = xv15_profile() if profile is None else profile
            _within("power", self.power, 0.0, engine_rating(aircraft, "contingency"), "W")
            return transmission_efficiency(aircraft) * (self.power + engine_rating(aircraft, self.other_engine))
        for number in (self.bias, self.rate):
            if number is not None:
                return number
        return 0.0


def check_sides(fault: Fault, *, rolls: bool) -> None:
    """Refuse a failure that an aircraft has nothing for.

    Args:
        fault: The failure.
        rolls: The aircraft leaves its plane of symmetry.

    Raises:
        InputError: The failure acts on one side, and the aircraft has but one half.
    """
    if fault.leaves_symmetry and not rolls:
        key, value = ("actuator", fault.actuator) if fault.actuator else ("control", fault.control)
        raise InputError(
            "this aircraft moves in its plane of symmetry alone, where that cannot fail by itself",
            key=f"faults.{key}", value=value, allowed="collective, cyclic, elevator; stick, lever",
            mend="fly the plant lpv or nonlinear of an aircraft with a lateral half",
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class FaultSwitch:
    """A failure that begins or ends by hand, whatever its times say."""

    fault: Fault
    """The failure."""
    on: bool
    """Begins; else ends."""


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """A change as the event log records it."""

    time: float
    """When [s]."""
    name: str
    """The failure, and whether it begins or ends: ``cyclic-stuck on``."""
    value: float
    """Its size, see ``Fault.size``."""


def fault_events(faults: Sequence[Fault], profile: AircraftProfile | None = None) -> tuple[FaultEvent, ...]:
    """Give the changes of a flight's failures in the order in which the kernels make them.

    Args:
        faults: The failures.
    """
    return tuple(
        FaultEvent(time, f"{fault.name} {'on' if on else 'off'}", fault.size(profile))
        for time, fault, on in fault_changes(faults)
    )


def fault_changes(faults: Sequence[Fault]) -> list[tuple[float, Fault, bool]]:
    """Give all changes in time, with whether they begin; at one time what ends goes before what begins, then as listed.

    Args:
        faults: The failures.
    """
    changes = [(fault.start, fault, True) for fault in faults]
    changes += [(fault.end, fault, False) for fault in faults if fault.end is not None]
    return sorted(changes, key=lambda change: (change[0], change[2]))


def _choice(key: str, value: str, allowed: Sequence[str]) -> None:
    if value not in allowed:
        raise InputError("is not known", key=key, value=value, allowed=", ".join(allowed), mend="choose one")


def _within(key: str, value: float, low: float, high: float, unit: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError("is out of range", key=key, value=value, allowed=f"{low:.4g} to {high:.4g} {unit}")
