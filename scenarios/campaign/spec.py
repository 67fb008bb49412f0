"""What a campaign file may say: classes of flights as distributions, and what is expected of the law.

Every number has its unit in its key. A number may be a constant or a distribution; unknown keys are errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, create_model

from rtsim.choices import CorridorName
from rtsim.errors import InputError
from rtsim.faults.fault import Actuator, Control, Fault, FaultKind, Stop
from rtsim.loop.option_tables import table_fields
from rtsim.loop.options import declared
from rtsim.loop.script import Channel, Shape
from rtsim.strict import Examined, Strict
from rtsim.toml_file import named_text, parse_toml
from scenarios.campaign.events import EVENTS
from scenarios.files.disturbances import FAULT_KEYS, faults_of
from scenarios.files.expectation import name_problems, property_problems
from scenarios.files.schema import FaultTable
from scenarios.files.trial import LARGEST_PULSES

Generator = np.random.Generator
Finite = Annotated[float, Field(allow_inf_nan=False)]
LIBRARY = "scenarios/campaign/library"
"""Where the campaigns lie that come with rtsim."""


LARGEST_FAULT_RATE_DEG_S = 200.0
"""Fastest motion that may be left to a failed actuator [deg/s]."""
LARGEST_SWITCH_DEG_S = 12.0
"""Largest nacelle rate that a switch may ask for [deg/s]."""
FILE_OPTIONS = tuple(item for item in declared().values() if item.campaign == "file")
"""Options of a flight that a campaign gives once."""
CLASS_OPTIONS = tuple(item for item in declared().values() if item.campaign == "classes")
"""Options of a flight that each class gives; numbers may be distributions."""
RANGES: dict[str, tuple[float, float]] = {
    "nacelle_deg": (0.0, 90.0),
    "target_deg": (0.0, 90.0),
    "rate_deg_s": (0.0, 12.0),
    "acceleration_kt_s": (0.0, 20.0),
    "begin_s": (0.0, 3600.0),
    "time_s": (0.0, 3600.0),
    "duration_s": (0.0, 3600.0),
    "gap_s": (0.0, 3600.0),
    "period_s": (0.05, 600.0),
    "count": (0.0, 1000.0),
    "reaction_s": (0.0, 3600.0),
    "roll_s": (0.1, 60.0),
    "bank_deg": (-60.0, 60.0),
    "turn_rate_deg_s": (-30.0, 30.0),
    "bias_kt": (-100.0, 100.0),
    "power_shp": (0.0, 1802.0),
    "turbulence_kt": (0.0, 100.0),
    "ahead_kt": (-200.0, 200.0),
    "below_kt": (-200.0, 200.0),
    "lateral_kt": (-200.0, 200.0),
} | {item.key: (item.low, item.high) for item in CLASS_OPTIONS if item.low is not None and item.high is not None}
"""What numbers and the certain part of distributions must lie in, by key."""


class Uniform(Strict):
    """Evenly between two numbers."""

    uniform: Annotated[list[Finite], Field(min_length=2, max_length=2)]


class Normal(Strict):
    """A normal distribution: mean and standard deviation, cut at three deviations."""

    normal: Annotated[list[Finite], Field(min_length=2, max_length=2)]


class Choice(Strict):
    """One of several numbers, equally likely unless weighted."""

    choice: Annotated[list[Finite], Field(min_length=1, max_length=1000)]
    weights: list[Annotated[float, Field(ge=0.0, allow_inf_nan=False)]] | None = None


Number = Finite | Uniform | Normal | Choice
"""A constant or a distribution."""


class StartDraw(Strict):
    """``start``: where the flight begins; outside the corridor, or without trim, it is drawn again."""

    airspeed_kt: Number | None = None
    above_low_kt: Number | None = None
    nacelle_deg: Number = 90.0
    altitude_m: Number = 300.0
    margin_kt: Annotated[float, Field(ge=0.0, le=50.0)] = 3.0


class SpeedDraw(Strict):
    """``speed``: the airspeed the pilot goes for."""

    begin_s: Number = 1.0
    acceleration_kt_s: Number = 3.0
    target_kt: Number | None = None
    beyond_high_kt: Number | None = None
    beyond_low_kt: Number | None = None


class NacelleDraw(Strict):
    """``nacelle``: the nacelle angle the programme goes for."""

    begin_s: Number = 1.0
    rate_deg_s: Number = 3.0
    target_deg: Number


class PulseDraw(Strict):
    """One of ``pulses``: movements of a control, one after the other."""

    channel: Channel
    count: Number = 1.0
    time_s: Number = 2.0
    duration_s: Number
    gap_s: Number = 0.0
    amount: Number
    either_sign: bool = False
    shape: Shape = "step"
    period_s: Number = 1.0
    replaces: bool = False


class SignalDraw(Strict):
    """One of ``signals``: a control moved all the time, by steps that follow each other twice in a period."""

    channel: Channel
    begin_s: Number = 1.0
    duration_s: Annotated[float, Field(gt=0.0, le=600.0)]
    bandwidth_hz: Annotated[float, Field(ge=0.01, le=5.0)]
    amount: Number
    replaces: bool = False


class TurnDraw(Strict):
    """``turn``: the turn the programme asks for, and keeps asking for."""

    begin_s: Number = 2.0
    roll_s: Number = 2.0
    bank_deg: Number | None = None
    turn_rate_deg_s: Number | None = None
    either_sign: bool = False


class FaultDraw(Strict):
    """One of ``faults``: the keys of a scenario's, numbers drawn, and one of what is listed."""

    kind: FaultKind
    time_s: Number
    duration_s: Number | None = None
    bias_kt: Number | None = None
    rate_deg_s: Number | None = None
    power_shp: Number | None = None
    actuator: Actuator | list[Actuator] | None = None
    control: Control | list[Control] | None = None
    stop: Stop | list[Stop] | None = None


class GustDraw(Strict):
    """One of ``gusts``: one-minus-cosine."""

    time_s: Number
    duration_s: Number
    ahead_kt: Number = 0.0
    below_kt: Number = 0.0
    lateral_kt: Number = 0.0
    either_sign: bool = False


class PilotDraw(Strict):
    """``pilot``: how the built-in pilot behaves."""

    yields: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    reaction_s: Number = 0.8
    noise: bool = False


_ClassOptions: Any = create_model("_ClassOptions", __base__=Strict, **table_fields(CLASS_OPTIONS, number=Number))
_FileOptions: Any = create_model("_FileOptions", __base__=Strict, **table_fields(FILE_OPTIONS))


class ClassTable(_ClassOptions, Strict):  # type: ignore[misc]  # made from the options' declaration
    """One of ``[[classes]]``: a kind of flight."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]*$", max_length=60)]
    title: str = ""
    nominal: bool = False
    """Flights in which a law should do nothing for the corridor's sake."""
    runs: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    duration_s: Annotated[float, Field(gt=0.0, le=3600.0)] | None = None
    scenarios: list[str] = []
    """Library scenarios to choose from, with their own air, failures, movements and options; replaces start, speed and
    nacelle."""
    start: StartDraw | None = None
    speed: SpeedDraw | None = None
    nacelle: NacelleDraw | None = None
    turn: TurnDraw | None = None
    pulses: list[PulseDraw] = []
    signals: list[SignalDraw] = []
    faults: list[FaultDraw] = []
    gusts: list[GustDraw] = []
    turbulence_kt: Number = 0.0
    lateral_turbulence: bool = False
    pilot: PilotDraw = PilotDraw()


class ExpectRate(Strict):
    """One of ``[[expect]]``: how often something may or must happen."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    event: str | None = None
    property: str | None = None
    """A formula of signal temporal logic; what is counted are the flights that break it."""
    of: str = "law"
    classes: list[str] = []
    upper_max: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    rate_max: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    rate_min: Annotated[float, Field(ge=0.0, le=1.0)] | None = None


class CampaignFile(_FileOptions, Strict):  # type: ignore[misc]  # made from the options' declaration
    """A whole campaign file."""

    format: Literal[1]
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=100)]
    title: Annotated[str, Field(min_length=1, max_length=200)]
    description: str = ""
    law: str = "full"
    against: list[str] = []
    corridor: CorridorName = "flight"
    duration_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 40.0
    runs: Annotated[int, Field(ge=1, le=10_000_000)] = 50
    confidence: Annotated[float, Field(gt=0.5, lt=1.0)] = 0.95
    classes: Annotated[list[ClassTable], Field(min_length=1, max_length=1000)]
    expect: list[ExpectRate] = []


def properties_of(spec: CampaignFile) -> tuple[str, ...]:
    """Formulas that a campaign asks of its flights, each once, in their order.

    Args:
        spec: The campaign.
    """
    return tuple(dict.fromkeys(clause.property for clause in spec.expect if clause.property is not None))


def load_campaign(name_or_path: str | Path) -> tuple[CampaignFile, str]:
    """Read a campaign file.

    Args:
        name_or_path: A campaign that comes with rtsim by name, or a path (with ``/`` or ending in ``.toml``).

    Returns:
        The campaign and its text.

    Raises:
        InputError: For the first mistake found.
    """
    text, file = named_text(name_or_path, folder=LIBRARY, noun="campaign", key="campaign")
    spec, problems = parse_campaign(text, file=file)
    if spec is None:
        raise problems[0]
    return spec, text


def parse_campaign(text: str, *, file: str) -> tuple[CampaignFile | None, list[InputError]]:
    """Check the text of a campaign file.

    Args:
        text: The TOML text.

    Returns:
        The campaign and no problems, or None and at least one.
    """
    try:
        examined = examine_campaign(text, file=file)
    except InputError as error:
        return None, [error]
    return (None, examined.problems) if examined.problems else (examined.content, [])


def examine_campaign(text: str, *, file: str) -> Examined[CampaignFile]:
    """Find every mistake that a text shows by itself.

    Args:
        text: The TOML text.

    Raises:
        InputError: It is not valid TOML.
    """
    examined = Examined(CampaignFile, parse_toml(text, file=file), file=file)
    examined.ask(lambda spec: _class_contradictions(spec, file), lambda spec: _expectation_contradictions(spec, file))
    return examined


def draw(number: Number, generator: Generator) -> float:
    """Draw one number.

    Args:
        number: A constant or a distribution; a constant draws nothing.
        generator: Where from.
    """
    if isinstance(number, Uniform):
        low, high = number.uniform
        return float(generator.uniform(low, high))
    if isinstance(number, Normal):
        mean, deviation = number.normal
        return mean + deviation * float(np.clip(generator.standard_normal(), -3.0, 3.0))
    if isinstance(number, Choice):
        weights = number.weights
        shares = None if weights is None else np.array(weights) / sum(weights)
        return float(generator.choice(number.choice, p=shares))
    return number


def _class_contradictions(spec: CampaignFile, file: str) -> list[InputError]:
    found: list[InputError] = []
    names = [item.name for item in spec.classes]
    for number, item in enumerate(spec.classes):
        key = f"classes[{number}]"
        if names.index(item.name) != number:
            found.append(InputError("is used twice", file=file, key=f"{key}.name", value=item.name))
        found += [InputError(problem, file=file, key=f"{key}{place}", mend=mend) for place, problem, mend in _odd(item)]
        found += _number_problems(item, key, file)
    return found


def _expectation_contradictions(spec: CampaignFile, file: str) -> list[InputError]:
    found: list[InputError] = []
    names = [item.name for item in spec.classes]
    for number, clause in enumerate(spec.expect):
        key = f"expect[{number}]"
        if (clause.event is None) == (clause.property is None):
            mend = "give one of them"
            found.append(InputError("needs either event or property", file=file, key=key, mend=mend))
        if clause.event is not None:
            found += name_problems(clause.event, EVENTS, "an event", file=file, key=f"{key}.event")
        if clause.property is not None:
            found += property_problems(clause.property, file=file, key=f"{key}.property")
        laws = ("law", "off", spec.law, *spec.against)
        if clause.of not in laws:
            found.append(
                InputError("is not flown", file=file, key=f"{key}.of", value=clause.of, allowed=", ".join(laws))
            )
        if clause.upper_max is None and clause.rate_max is None and clause.rate_min is None:
            found.append(InputError("has no limit", file=file, key=key, mend="add upper_max, rate_max or rate_min"))
        found += [
            InputError("is not a class", file=file, key=f"{key}.classes", value=name, allowed=", ".join(names))
            for name in clause.classes
            if name not in names
        ]
    return found


def _odd(item: ClassTable) -> list[tuple[str, str, str]]:
    """What does not go together in a class: key, problem, mend."""
    found = []
    if item.scenarios and (item.start or item.speed or item.nacelle or item.turn):
        found.append(("", "has scenarios and a start of its own", "keep either"))
    if not item.scenarios and item.start is None:
        found.append((".start", "is missing", "say where flights begin, or give scenarios"))
    if item.start is not None and (item.start.airspeed_kt is None) == (item.start.above_low_kt is None):
        found.append((".start", "needs either airspeed_kt or above_low_kt", "give one of them"))
    if item.speed is not None:
        targets = (item.speed.target_kt, item.speed.beyond_high_kt, item.speed.beyond_low_kt)
        if sum(target is not None for target in targets) != 1:
            found.append((".speed", "needs one of target_kt, beyond_high_kt and beyond_low_kt", "give one of them"))
    if item.turn is not None and (item.turn.bank_deg is None) == (item.turn.turn_rate_deg_s is None):
        found.append((".turn", "needs either bank_deg or turn_rate_deg_s", "give one of them"))
    for number, fault in enumerate(item.faults):
        try:
            fault_of(fault, lambda _, number: _extremes(number)[0], lambda _, listed: listed[0])
        except InputError as error:
            key = FAULT_KEYS.get(error.key or "", error.key)
            found.append((f".faults[{number}].{key}", error.problem, error.mend or "correct it"))
    return found


def fault_of(
    table: FaultDraw,
    number: Callable[[str, Number], float],
    one: Callable[[str, Sequence[Any]], Any],
    begins: float = 0.0,
) -> Fault:
    """Make a failure of a class.

    Args:
        table: What the class says.
        number: Draws the number of a key.
        one: Chooses one of what is listed for a key.
        begins: When [s].

    Raises:
        InputError: The kind of failure lacks a key, or has one too many.
    """
    duration = None if table.duration_s is None else max(number("duration_s", table.duration_s), 0.01)
    keys: dict[str, Any] = {"kind": table.kind, "time_s": begins}
    keys["end_s"] = None if duration is None else begins + duration
    for name in ("bias_kt", "rate_deg_s", "power_shp"):
        value = getattr(table, name)
        keys[name] = None if value is None else number(name, value)
    for name in ("actuator", "control", "stop"):
        value = getattr(table, name)
        keys[name] = one(name, value) if isinstance(value, list) else value
    return faults_of([FaultTable(**keys)])[0]


def _number_problems(
    table: BaseModel, key: str, file: str, *, limits: tuple[float, float] | None = None
) -> list[InputError]:
    """Distributions that are none, and numbers that mean nothing, in a table and what it holds."""
    if isinstance(table, Uniform | Normal | Choice):
        return _distribution_problems(table, key, file) or _range_problems(_extremes(table), key, file, limits)
    found: list[InputError] = []
    for name in type(table).model_fields:
        value, place = getattr(table, name), f"{key}.{name}"
        allowed = RANGES.get(name)
        if isinstance(table, PulseDraw | SignalDraw) and name == "amount":
            largest = LARGEST_PULSES.get(table.channel, LARGEST_SWITCH_DEG_S)
            allowed = (-largest, largest)
        if isinstance(table, FaultDraw) and name == "rate_deg_s":
            allowed = (0.0, LARGEST_FAULT_RATE_DEG_S)
        if isinstance(value, BaseModel):
            found += _number_problems(value, place, file, limits=allowed)
        elif isinstance(value, list):
            for number, part in enumerate(value):
                if isinstance(part, BaseModel):
                    found += _number_problems(part, f"{place}[{number}]", file)
        elif isinstance(value, float | int) and not isinstance(value, bool):
            found += _range_problems([value], place, file, allowed)
    return found


def _extremes(number: Number) -> list[float]:
    """What is certain to be drawn or nearly; the tails of a normal distribution are not."""
    if isinstance(number, float | int):
        return [float(number)]
    if isinstance(number, Uniform):
        return number.uniform
    return number.normal[:1] if isinstance(number, Normal) else number.choice


def _distribution_problems(number: Uniform | Normal | Choice, key: str, file: str) -> list[InputError]:
    if isinstance(number, Uniform) and number.uniform[0] > number.uniform[1]:
        return [InputError("ends before it begins", file=file, key=f"{key}.uniform", value=number.uniform, mend="swap")]
    if isinstance(number, Normal) and number.normal[1] < 0.0:
        mend = "give mean and standard deviation"
        return [InputError("has a negative deviation", file=file, key=f"{key}.normal", value=number.normal, mend=mend)]
    if isinstance(number, Choice) and number.weights is not None:
        weights, place = number.weights, f"{key}.weights"
        if len(weights) != len(number.choice):
            mend = f"give {len(number.choice)}, one for each choice"
            return [InputError("does not fit choice", file=file, key=place, value=weights, mend=mend)]
        if sum(weights) <= 0.0:
            return [InputError("are all 0", file=file, key=place, value=weights, mend="give one a weight above 0")]
    return []


def _range_problems(values: list[float], key: str, file: str, limits: tuple[float, float] | None) -> list[InputError]:
    if limits is None:
        return []
    low, high = limits
    return [
        InputError("is out of range", file=file, key=key, value=value, allowed=f"{low:g} to {high:g}")
        for value in values
        if not low <= value <= high
    ][:1]
