"""Stick maps: TOML files that say which axis and button does what, checked key by key.

There are two kinds. A *vehicle* map says which axes of MANUAL_CONTROL move the aircraft and how they are shaped
(``rtsim fly --stick-map``); a *gamepad* map says which axes and buttons of a device become MANUAL_CONTROL
(``rtsim joystick --map``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from rtsim.errors import InputError
from rtsim.strict import Examined, Strict
from rtsim.toml_file import named_text, parse_toml, shipped_names

LIBRARY = "telemetry/joystick/maps"
"""Where the maps lie that come with rtsim."""
_Part = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
_DeadBand = Annotated[float, Field(ge=0.0, le=0.3, allow_inf_nan=False)]
_ManualAxis = Annotated[str, Field(pattern=r"^(-?(x|y|z|r|s|t|aux[1-6]))?$")]
_Button = Annotated[int, Field(ge=0, le=31)]
_DeviceButton = Annotated[int, Field(ge=0, le=255)]
Function = Literal[
    "nacelle_aft",
    "nacelle_forward",
    "rate_damping",
    "freeze",
    "attitude_retention",
    "pilot",
    "trim_forward",
    "trim_aft",
    "automatic_flaps",
    "flaps_up",
    "flaps_down",
    "governor",
    "trim_left",
    "trim_right",
]
"""What a button of the vehicle can do."""
DeviceFunction = Literal[Function, "arm", "reset", "lever_up", "lever_down"]
"""What a button of a gamepad can do."""


class Shape(Strict):
    """``[shape]`` of a vehicle map: stick and pedals."""

    dead_band: _DeadBand = 0.0
    """Part of half travel around the centre that counts as the centre."""
    expo: _Part = 0.0
    """0 straight, 1 cubic."""
    scale: Annotated[float, Field(ge=0.1, le=1.0, allow_inf_nan=False)] = 1.0
    """Stick and pedals at full deflection, part of half travel."""


class NacelleSwitchTable(Strict):
    """``[nacelle]`` of a vehicle map."""

    detents: bool = False
    """Runs to detents (the paper's switch) instead of moving while held."""
    rate_deg_s: Annotated[float, Field(ge=0.5, le=7.5, allow_inf_nan=False)] = 7.5
    """Rate of switch and commands [deg/s]."""


class VehicleMap(Strict):
    """A vehicle map."""

    format: Literal[1] = 1
    """Version of the layout."""
    kind: Literal["vehicle"] = "vehicle"
    """Which kind of map this is."""
    axes: dict[Literal["stick", "lateral", "lever", "yaw", "nacelle"], _ManualAxis] = {}
    """MANUAL_CONTROL axis behind each control; a leading ``-`` reverses, an empty text takes it away."""
    shape: Shape = Shape()
    """Shaping of stick and pedals."""
    nacelle: NacelleSwitchTable = NacelleSwitchTable()
    """The nacelle switch."""
    buttons: dict[Function, _Button] = {}
    """Bit of MANUAL_CONTROL behind each function."""


class DeviceAxis(Strict):
    """One axis of a gamepad."""

    index: Annotated[int, Field(ge=0, le=63)]
    """Number of the axis at the device."""
    reverse: bool = False
    """Whether its direction is turned round."""
    dead_band: _DeadBand = 0.05
    """Part of half travel around the centre that counts as the centre."""
    expo: _Part = 0.0
    """0 straight, 1 cubic."""


class LeverAxis(DeviceAxis):
    """The axis behind the power lever."""

    mode: Literal["absolute", "rate"] = "rate"
    """``absolute``: the axis is the lever; ``rate``: it moves the lever, for sticks that spring back."""
    rate_per_s: Annotated[float, Field(ge=0.02, le=5.0, allow_inf_nan=False)] = 0.3
    """Lever travel per second at full deflection, mode ``rate``."""


class DeviceAxes(Strict):
    """``[axes]`` of a gamepad map."""

    stick: DeviceAxis
    """Longitudinal stick, forward positive after ``reverse``."""
    lateral: DeviceAxis | None = None
    """Lateral stick, right positive."""
    yaw: DeviceAxis | None = None
    """Pedals, right positive."""
    lever: LeverAxis | None = None
    """Power lever, up positive."""


class GamepadMap(Strict):
    """A gamepad map."""

    format: Literal[1] = 1
    """Version of the layout."""
    kind: Literal["gamepad"]
    """Which kind of map this is."""
    name: Annotated[str, Field(min_length=1, max_length=100)]
    """The device, for people."""
    match: list[Annotated[str, Field(min_length=2, max_length=100)]] = []
    """Parts of the names under which the device shows up, or whole names after ``=``; capitals do not matter."""
    axes: DeviceAxes
    """Its axes."""
    buttons: dict[DeviceFunction, _DeviceButton] = {}
    """Button number at the device behind each function."""
    hat_buttons: dict[Literal["up", "down", "left", "right"], DeviceFunction] = {}
    """What the directions of the first hat (the cross) do."""


StickMap = VehicleMap | GamepadMap
"""Either kind of map."""


def map_names() -> list[str]:
    """Names of the maps that come with rtsim, sorted."""
    return shipped_names(LIBRARY)


def load_stick_map(name_or_path: str | Path) -> StickMap:
    """Load a map.

    Args:
        name_or_path: A library name, or a path; a word with a ``/`` or ending in ``.toml`` is a path.

    Raises:
        InputError: It does not exist or is wrong; the first mistake is told.
    """
    text, file = named_text(name_or_path, folder=LIBRARY, noun="stick map", key="--map")
    return parse_stick_map(text, file=file)


def load_vehicle_map(name_or_path: str | Path | None) -> VehicleMap:
    """Load a vehicle map.

    Args:
        name_or_path: As for ``load_stick_map``; None is the standard map.

    Raises:
        InputError: It does not exist, is wrong, or is for a gamepad.
    """
    if name_or_path is None:
        return VehicleMap()
    found = load_stick_map(name_or_path)
    if not isinstance(found, VehicleMap):
        raise _wrong_kind(name_or_path, "vehicle", "rtsim joystick --map")
    return found


def load_gamepad_map(name_or_path: str | Path) -> GamepadMap:
    """Load a gamepad map.

    Args:
        name_or_path: As for ``load_stick_map``.

    Raises:
        InputError: It does not exist, is wrong, or is for the vehicle.
    """
    found = load_stick_map(name_or_path)
    if not isinstance(found, GamepadMap):
        raise _wrong_kind(name_or_path, "gamepad", "rtsim fly --stick-map")
    return found


def gamepad_map_for(device: str) -> tuple[str, GamepadMap] | None:
    """The shipped map of a device.

    Args:
        device: The name under which it shows up.

    Returns:
        Name and map; None where no map matches.
    """
    for name in map_names():
        found = load_stick_map(name)
        if isinstance(found, GamepadMap) and any(_matches(part, device) for part in found.match):
            return name, found
    return None


def _matches(part: str, device: str) -> bool:
    part, device = part.lower(), device.lower()
    return part[1:] == device if part.startswith("=") else part in device


def parse_stick_map(text: str, *, file: str) -> StickMap:
    """Check the text of a map.

    Args:
        text: The TOML text.

    Raises:
        InputError: For the first mistake found.
    """
    found, problems = examine_stick_map(parse_toml(text, file=file), file=file)
    for problem in problems:
        raise problem
    return found


def examine_stick_map(data: dict[str, Any], *, file: str) -> tuple[StickMap, list[InputError]]:
    """Find every mistake of a map.

    Args:
        data: Its tables.

    Returns:
        The map as far as it can be understood, and the mistakes.
    """
    kind = data.get("kind")
    models: dict[Any, type[StickMap]] = {"vehicle": VehicleMap, "gamepad": GamepadMap}
    problems = []
    if not isinstance(kind, str) or kind not in models:
        mend = "choose one"
        problems.append(
            InputError(
                "is no kind of stick map", file=file, key="kind", value=kind, allowed="vehicle, gamepad", mend=mend
            )
        )
        kind = "gamepad" if {"match", "hat_buttons"} & set(data) else "vehicle"
        data = {**data, "kind": kind}
    examined: Examined[Any] = Examined(models[kind], data, file=file)
    examined.ask(lambda content: _shared(content, file))
    return examined.content, problems + examined.problems


def _shared(found: StickMap, file: str) -> list[InputError]:
    """Axes and buttons that have two things to do: neither would work."""
    problems = []
    if isinstance(found, VehicleMap):
        from telemetry.mavlink.pilot_input import STANDARD_AXES, STANDARD_BUTTONS

        axes = STANDARD_AXES | {str(control): source for control, source in found.axes.items()}
        sources = {control: source.removeprefix("-") for control, source in axes.items() if source}
        buttons = STANDARD_BUTTONS | {str(function): number for function, number in found.buttons.items()}
    else:
        sources = {control: axis["index"] for control, axis in found.axes.model_dump(exclude_none=True).items()}
        buttons = {str(function): number for function, number in found.buttons.items()}
    for table, places in (("axes", sources), ("buttons", buttons)):
        first: dict[Any, str] = {}
        for key, place in places.items():
            other = first.setdefault(place, key)
            if other != key:
                mend = f"move {table}.{other} or {table}.{key}"
                problem = f"is used by {table}.{other} too"
                problems.append(InputError(problem, file=file, key=f"{table}.{key}", value=place, mend=mend))
    return problems


def _wrong_kind(name: object, wanted: str, command: str) -> InputError:
    return InputError(
        f"is not a {wanted} map", key="kind", file=str(name), allowed=wanted, mend=f"it is meant for {command}"
    )
