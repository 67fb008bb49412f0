"""The options of a flight, each declared once.

A field of :class:`FlightOptions` is a key of a scenario's ``[flight]``, an option of ``rtsim fly``, a field of
``Overrides``, a value in the JSON of a flight and in the setup that a log keeps for its replay, where it makes sense a
key of a campaign's classes, and a row of the tables in the docs (``python -m docs.tables`` writes them). To add one,
declare it here and use it where it acts. Importing this loads no compiled code.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from rtsim.aircraft.condition import SHIPPED, AircraftCondition, AircraftName
from rtsim.choices import BUILT_IN_PILOT, HAND_PILOT, PASSIVE_LAWS, AidName, CorridorName, OuterLoop, PlantName
from rtsim.errors import InputError, suggestion
from rtsim.units import DEGREE, FOOT, INCH, KNOT, POUND, POUND_FORCE, RPM

FULL_ROTOR_SPEED = 0.0
"""Rotor speed of a flight that is asked for none: the aircraft's own in conversion [rad/s]."""
FROM_BEHIND = -DEGREE
"""Direction of a wind that is given none: it blows along the heading at the start [rad]."""
EVERY_HEIGHT = 0.0
"""Reference height of a wind that is the same at every height [m]."""
FULL_TANKS = 1490.0 * POUND_FORCE
"""Fuel of a flight that is asked for none: the XV-15's full tanks, and another aircraft's own [N]."""
CONDITION = ("mass", "density_altitude", "cg_forward")
"""Options that are the condition of the aircraft."""
CONDITION_FLAGS = "--weight-lb, --density-altitude-ft, --cg-in"
_PLUG_IN = r"[A-Za-z_][\w.-]*(:[A-Za-z_]\w*)?"

Campaign = Literal["file", "classes", "own"]
"""Where a campaign says it: once in its file, in each class (numbers also as distributions), or in words of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """What is declared of an option besides its type and its default."""

    help: str
    """What it means, as one line of ``--help`` and of the docs."""
    panel: str
    """Heading it stands under in ``rtsim fly --help``."""
    name: str = ""
    """Name of the field; filled in."""
    key: str = ""
    """Name in files and JSON; by default the field's."""
    flag: str = ""
    """Name on the command line; by default the key with dashes."""
    kind: Any = None
    """Type of the value; filled in."""
    default: Any = None
    """Default, SI; filled in."""
    default_words: str = ""
    """The default in words, where the value does not say it."""
    unit: str = ""
    """Unit in files, on the command line and in JSON."""
    factor: float = 1.0
    """That unit in SI."""
    low: float | None = None
    """Smallest value, in the unit."""
    high: float | None = None
    """Largest value, in the unit."""
    values: str = ""
    """What may be given, in words, for a text."""
    pattern: str = ""
    """Regular expression of a text."""
    longest: int = 1000
    """Characters of a text at most."""
    is_file: bool = False
    """Whether it names a file; one in a scenario lies beside the scenario."""
    page: str = ""
    """Page of the docs that says more."""
    campaign: Campaign = "classes"
    """Where a campaign says it."""

    @property
    def choices(self) -> tuple[str, ...]:
        """Words to choose from, or from which several are chosen; empty where it is no such option."""
        kinds = [self.kind, *get_args(self.kind)]
        return next((get_args(kind) for kind in kinds if get_origin(kind) is Literal), ())

    @property
    def is_list(self) -> bool:
        """Whether several words can be given."""
        return get_origin(self.kind) is tuple

    @property
    def is_number(self) -> bool:
        """Whether it is a number that need not be whole, so that a campaign can draw it."""
        return self.kind is float

    @property
    def default_text(self) -> str:
        """The default as shown to people, in the unit."""
        if self.default_words:
            return self.default_words
        if isinstance(self.default, bool):
            return "on" if self.default else "off"
        return f"{self.shown(self.default):g}" if isinstance(self.default, float) else str(self.default)

    @property
    def allowed(self) -> str:
        """What may be given, in words."""
        if self.choices:
            return ", ".join(self.choices)
        if self.low is not None and self.high is not None:
            return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()
        return self.values or {bool: "on, off", str: "a text"}.get(self.kind, "a number")

    def shown(self, value: Any) -> Any:
        """A value of the option in its unit.

        Args:
            value: SI.
        """
        return value / self.factor if self.is_number else list(value) if self.is_list else value

    def inside(self, value: Any) -> Any:
        """A value as a flight keeps it.

        Args:
            value: In the option's unit.

        Returns:
            The value in SI; words of a list without repetitions.
        """
        return value * self.factor if self.is_number else tuple(dict.fromkeys(value)) if self.is_list else value

    def check(self, value: Any) -> None:
        """Refuse a value that cannot be flown.

        Args:
            value: SI.

        Raises:
            InputError: It is out of range or none of the choices; the option is named as on the command line.
        """
        shown, slack = self.shown(value), 1e-9 if self.is_number else 0
        if self.choices:
            for word in shown if self.is_list else [value]:
                if word is not None and word not in self.choices:
                    mend = suggestion(str(word), self.choices, otherwise="choose one")
                    raise InputError(
                        "is not one of the choices", key=self.flag, value=word, allowed=self.allowed, mend=mend
                    )
        elif self.low is not None and self.high is not None and not self.low - slack <= shown <= self.high + slack:
            mend = "choose a value in this range"
            raise InputError("is out of range", key=self.flag, value=shown, allowed=self.allowed, mend=mend)


def option(default: Any, **declared: Any) -> Any:
    """Declare a field of a flight's options.

    Args:
        default: Its default, SI.
        declared: Fields of :class:`Option`.
    """
    return dataclasses.field(default=default, metadata={"option": Option(**declared)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions:
    """Who flies what, and how: what a scenario, a trial and a simulation have in common. SI and radians."""

    plant: PlantName = option(
        "lpv",
        help="Aircraft: the layered LPV model, the paper's plain one, or the nonlinear one.",
        panel="Who flies what",
        page="lpv.md",
        campaign="file",
    )
    outer_loop: OuterLoop = option(
        "integrators",
        help="How the MOCM holds airspeed and altitude: integrators in its design, or the paper's PI loops.",
        panel="Who flies what",
        page="pilot.md",
    )
    pilot: str = option(
        BUILT_IN_PILOT,
        help="Who flies: mocm (the virtual pilot), mavlink (you), an installed pilot, or MODULE:CLASS.",
        panel="Who flies what",
        values="mocm, mavlink, an entry point's name, MODULE:CLASS",
        pattern=rf"^{_PLUG_IN}$",
        longest=200,
        page="flying.md",
        campaign="own",
    )
    corridor: CorridorName | None = option(
        None,
        help="Boundaries to watch: TM X-62407's chart, the stall line flown (TM 81244), or the model's own trims.",
        panel="Who flies what",
        default_words="design, or flight with a protection that acts",
        page="corridor.md",
        campaign="own",
    )
    protection: str = option(
        "monitor",
        help="off; monitor: warn; governor: limit the nacelles; full: stick and lever too; MODULE:CLASS; or A,B.",
        panel="Who flies what",
        values="off, monitor, governor, full, an entry point's name, MODULE:CLASS; several, separated by commas",
        pattern=rf"^{_PLUG_IN}( *, *{_PLUG_IN})*$",
        page="protection.md",
        campaign="own",
    )
    nacelle: str = option(
        "programme",
        help="Who sets the nacelle rate: programme, automatic (by airspeed) or MODULE:CLASS.",
        panel="Who flies what",
        values="programme, automatic, an entry point's name, MODULE:CLASS",
        pattern=rf"^{_PLUG_IN}$",
        longest=200,
        page="nacelle.md",
        campaign="own",
    )
    database: str = option(
        "",
        help="LPV database of your own (.nc, .mat).",
        panel="Who flies what",
        default_words="the shipped XV-15",
        values="a file",
        is_file=True,
        page="lpv.md",
        campaign="file",
    )
    mass: float = option(
        SHIPPED.mass,
        help="Weight of the XV-15; its database for it is built once, then kept.",
        panel="Who flies what",
        key="weight_lb",
        unit="lb",
        factor=POUND,
        low=9000.0,
        high=15000.0,
        page="lpv.md",
        campaign="file",
    )
    density_altitude: float = option(
        0.0,
        help="Air of the flight: that of the standard day at this height, all the way up and down.",
        panel="Who flies what",
        key="density_altitude_ft",
        unit="ft",
        factor=FOOT,
        low=-2000.0,
        high=15000.0,
        page="lpv.md",
        campaign="file",
    )
    cg_forward: float = option(
        0.0,
        help="Centre of gravity forward of its aft limit.",
        panel="Who flies what",
        key="cg_in",
        unit="in",
        factor=INCH,
        low=0.0,
        high=9.4,
        page="lpv.md",
        campaign="file",
    )
    aids: tuple[AidName, ...] = option(
        (),
        help="Pilot aids on at the start, separated by commas; they act on every pilot but the MOCM.",
        panel="Who flies what",
        default_words="none",
        page="aids.md",
    )
    automatic_flaps: bool = option(
        True,
        help="Let the flaps follow their schedule from the start, whoever flies; else they stay where they are.",
        panel="Who flies what",
        page="systems.md",
    )
    governor: bool = option(
        True,
        help="Let the governor hold the rotor speed from the start, whoever flies.",
        panel="Who flies what",
        page="systems.md",
    )
    automatic_rotor_speed: bool = option(
        False,
        help="Let the rotors come down to airplane speed by themselves on the downstop, and back up before the nacelles"
        " move.",
        panel="Who flies what",
        page="systems.md",
    )
    rotor_speed: float = option(
        FULL_ROTOR_SPEED,
        help="Rotor speed at the start, on the downstop: down to that of airplane mode.",
        panel="Start",
        key="rotor_rpm",
        unit="rpm",
        factor=RPM,
        low=10.0,
        high=30000.0,
        default_words="that of the conversion, 589",
        page="systems.md",
    )
    heading: float = option(
        0.0,
        help="Heading at the start, clockwise from north.",
        panel="Start",
        key="heading_deg",
        unit="deg",
        factor=DEGREE,
        low=0.0,
        high=360.0,
    )
    ground: bool = option(
        False,
        help="Put a flat ground under the wheels, with ground effect: land, stand, take off; else touching it ends the"
        " flight.",
        panel="Air",
        page="ground.md",
    )
    fuel: float = option(
        FULL_TANKS,
        help="Fuel at the start, no more than the tanks hold; the weight does not change with it.",
        panel="Start",
        key="fuel_lb",
        unit="lb",
        factor=POUND_FORCE,
        low=0.1,
        high=20000.0,
        default_words="full tanks, 1490",
        page="systems.md",
    )
    wind: float = option(
        0.0,
        help="Steady wind: a tailwind, negative a headwind; with a direction, the wind from there.",
        panel="Air",
        key="wind_kt",
        unit="kn",
        factor=KNOT,
        low=-40.0,
        high=40.0,
        page="atmosphere.md",
    )
    wind_from: float = option(
        FROM_BEHIND,
        help="Where the wind comes from, clockwise from north.",
        panel="Air",
        key="wind_from_deg",
        unit="deg",
        factor=DEGREE,
        low=0.0,
        high=360.0,
        default_words="from behind at the start",
        page="atmosphere.md",
    )
    wind_reference_height: float = option(
        EVERY_HEIGHT,
        help="Height at which the wind blows as given; with one, it is less below and more above.",
        panel="Air",
        key="wind_reference_height_m",
        unit="m",
        low=1.0,
        high=300.0,
        default_words="the same wind at every height",
        page="atmosphere.md",
    )
    pilot_noise: bool = option(
        False,
        help="Let the MOCM's observation and motor noise act.",
        panel="Who flies what",
        page="pilot.md",
        campaign="own",
    )
    rate_hz: int = option(
        250,
        help="Frames per second.",
        panel="Loop",
        flag="--rate",
        unit="Hz",
        low=50,
        high=1000,
        page="realtime.md",
        campaign="file",
    )
    seed: int = option(0, help="Root of every random stream.", panel="Loop", low=0, high=2**63 - 1, campaign="own")

    @property
    def corridor_name(self) -> CorridorName:
        """The corridor in force: the one asked for, else ``flight`` with a protection that acts and ``design``."""
        return self.corridor or ("design" if self.protection in PASSIVE_LAWS else "flight")

    @property
    def mocm_begins(self) -> bool:
        """Whether the virtual pilot flies at frame 0: he also holds the start for a person behind MAVLink."""
        return self.pilot in {BUILT_IN_PILOT, HAND_PILOT}

    @property
    def condition(self) -> AircraftCondition:
        """Weight, air and centre of gravity that are asked for."""
        return AircraftCondition(mass=self.mass, density_altitude=self.density_altitude, cg_forward=self.cg_forward)

    @property
    def aircraft(self) -> AircraftName:
        """What names the aircraft: the file of its database, empty for the shipped one, or a condition.

        Raises:
            InputError: A database is named, and a condition besides that of the shipped one.
        """
        if self.condition == SHIPPED:
            return self.database
        if self.database:
            raise InputError(
                "cannot be flown with a database of its own: that is for one weight, air and centre of gravity",
                key=CONDITION_FLAGS,
                value=str(self.condition),
                mend="leave one of the two out, or build the database for it (rtsim model build)",
            )
        return self.condition

    def changed(self, changes: Mapping[str, Any]) -> FlightOptions:
        """The options with some replaced.

        Args:
            changes: Values by field, SI.

        Raises:
            InputError: A value cannot be flown.
        """
        for name, value in changes.items():
            declared()[name].check(value)
        return dataclasses.replace(self, **changes)

    def shown(self) -> dict[str, Any]:
        """Every option by its key, in its unit, as JSON values."""
        return {item.key: item.shown(getattr(self, item.name)) for item in declared().values()}


def declared() -> Mapping[str, Option]:
    """What is declared of each option, by field, in order."""
    return _declared(FlightOptions)


@functools.cache
def _declared(kind: Any) -> Mapping[str, Option]:
    types = get_type_hints(kind)
    found = {}
    for field in dataclasses.fields(kind):
        item: Option = field.metadata["option"]
        key = item.key or field.name
        found[field.name] = dataclasses.replace(
            item,
            name=field.name,
            kind=types[field.name],
            default=field.default,
            key=key,
            flag=item.flag or f"--{key.replace('_', '-')}",
        )
    return found
