"""Air and failures between scenario files, flights and logs: tables to SI, what contradicts itself, events and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rtsim.atmosphere.specification import SEVERITY_WIND, AirSpecification, Gust, Turbulence
from rtsim.errors import InputError
from rtsim.faults.fault import Fault, FaultSwitch
from rtsim.units import HORSEPOWER, deg, kt, to_kt
from scenarios.files.schema import AirGustTable, AirTable, FaultTable

if TYPE_CHECKING:
    from rtsim.loop.simulation import Disturbance

FAULT_KEYS = {"rate": "rate_deg_s", "bias": "bias_kt", "power": "power_shp", "end": "end_s", "start": "time_s"}
"""Keys of a scenario file for the fields of a failure that differ from them."""
_GUST_KEYS = {"duration": "duration_s", "length": "length_m", "start": "time_s"}
DISTURBANCE_KINDS = ("gust", "turbulence", "failure")
"""Kinds of the events that change the air or let something fail by hand; a replay does them again."""


def disturbance_problems(air: AirTable, faults: Sequence[FaultTable], file: str) -> list[InputError]:
    """Mistakes in ``[air]`` and ``[[faults]]`` that involve more than one key.

    Args:
        air: The table of the air.
        faults: The failures.
    """
    found = []
    if air.turbulence is not None and air.wind_at_20_ft_kt is not None:
        found.append(
            InputError(
                "is given twice: by name and as a wind", file=file, key="air.turbulence", mend="delete wind_at_20_ft_kt"
            )
        )
    for number, gust in enumerate(air.gusts):
        found += _made(lambda gust=gust: _gust(gust), file, f"air.gusts[{number}]", _GUST_KEYS)
    for number, fault in enumerate(faults):
        found += _made(lambda fault=fault: _fault(fault), file, f"faults[{number}]", FAULT_KEYS)
    return found


def air_of(table: AirTable) -> AirSpecification:
    """Bring a checked table of the air to SI.

    Args:
        table: From a scenario file, without contradictions.
    """
    wind = SEVERITY_WIND[table.turbulence] if table.turbulence is not None else kt(table.wind_at_20_ft_kt or 0.0)
    return AirSpecification(
        turbulence=Turbulence(wind_at_20_ft=wind, fade_in=table.fade_in_s) if wind > 0.0 else None,
        gusts=tuple(_gust(gust) for gust in table.gusts),
        minimum_speed=kt(table.minimum_speed_kt),
        lateral=table.lateral,
    )


def faults_of(tables: Sequence[FaultTable]) -> tuple[Fault, ...]:
    """Bring checked failures to SI.

    Args:
        tables: From a scenario file, without contradictions.
    """
    return tuple(_fault(table) for table in tables)


def disturbance_event(change: Disturbance) -> tuple[str, str, dict[str, Any]]:
    """Describe a change made by hand as an event.

    Args:
        change: What is done to the flight.

    Returns:
        Kind, one line for people, and JSON values from which ``disturbance_from_event`` makes it again.
    """
    if isinstance(change, Gust):
        text = f"gust: {to_kt(change.ahead):+.1f} kn from ahead, {change.below:+.1f} m/s from below"
        text += f", {to_kt(change.lateral):+.1f} kn from the right" if change.lateral else ""
        return "gust", text, asdict(change)
    if isinstance(change, Turbulence):
        wind = to_kt(change.wind_at_20_ft)
        return "turbulence", f"turbulence of {wind:.0f} kn wind at 20 ft" if wind else "calm air", asdict(change)
    return "failure", fault_words(change.fault, on=change.on), {"fault": asdict(change.fault), "on": change.on}


def disturbance_from_event(kind: str, data: Mapping[str, Any]) -> Disturbance:
    """Make a change again that an event describes.

    Args:
        kind: One of ``DISTURBANCE_KINDS``.
        data: What ``disturbance_event`` gave, possibly with more keys.
    """
    if kind == "failure":
        return FaultSwitch(Fault(**data["fault"]), bool(data["on"]))
    kept: type[Gust | Turbulence] = Gust if kind == "gust" else Turbulence
    return kept(**{name: data[name] for name in kept.__dataclass_fields__})


def fault_words(fault: Fault, *, on: bool) -> str:
    """Say what fails or mends, for people.

    Args:
        fault: The failure.
        on: Begins; else ends.
    """
    return f"{'failure' if on else 'mended'}: {fault.name.replace('-', ' ')}"


def _gust(table: AirGustTable) -> Gust:
    return Gust(
        start=table.time_s,
        ahead=kt(table.ahead_kt),
        below=kt(table.below_kt),
        lateral=kt(table.lateral_kt),
        shape=table.shape,
        duration=table.duration_s,
        length=table.length_m,
        axes=table.axes,
    )


def _fault(table: FaultTable) -> Fault:
    return Fault(
        kind=table.kind,
        start=table.time_s,
        end=table.end_s,
        actuator=table.actuator,
        control=table.control,
        rate=None if table.rate_deg_s is None else deg(table.rate_deg_s),
        stop=table.stop,
        bias=None if table.bias_kt is None else kt(table.bias_kt),
        power=None if table.power_shp is None else table.power_shp * HORSEPOWER,
        other_engine=table.other_engine,
    )


def _made(make: Any, file: str, place: str, keys: Mapping[str, str]) -> list[InputError]:
    """The mistake that making it finds, in the words of the file; ranges were checked before, in the file's units."""
    try:
        make()
    except InputError as error:
        name = error.key or ""
        key = place if name == "gust" else f"{place}.{keys.get(name, name)}"
        mend = error.mend
        if name == "gust":
            mend = "give either duration_s or length_m"
        return [InputError(error.problem, file=file, key=key, value=error.value, allowed=error.allowed, mend=mend)]
    return []
