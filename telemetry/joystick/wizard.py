"""Finds out which axis and button of an unknown device is which, and writes a gamepad map."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence

from rtsim.whole_file import write_whole
from telemetry.joystick.mapping import DeviceState
from telemetry.joystick.stick_map import DeviceAxes, DeviceAxis, DeviceFunction, GamepadMap, LeverAxis

AXIS_QUESTIONS: tuple[tuple[str, str], ...] = (
    ("stick", "Push the stick that shall pitch FORWARD (nose down) and hold it"),
    ("lever", "Push the power lever UP (more power) and hold it"),
    ("lateral", "Push the stick that shall roll to the RIGHT and hold it"),
    ("yaw", "Push the pedals or the stick that shall yaw to the RIGHT and hold it"),
)
"""Control and what the user is asked to do; all but the first can be left out."""
BUTTON_QUESTIONS: tuple[tuple[DeviceFunction, str], ...] = (
    ("nacelle_forward", "Press the button for nacelles towards the AIRPLANE"),
    ("nacelle_aft", "Press the button for nacelles towards the HELICOPTER"),
    ("pilot", "Press the button that hands over between virtual pilot and you"),
    ("rate_damping", "Press the button that switches rate damping"),
    ("attitude_retention", "Press the button that switches attitude retention"),
    ("flaps_up", "Press the button that takes the flaps UP one setting"),
    ("flaps_down", "Press the button that takes the flaps DOWN one setting"),
    ("automatic_flaps", "Press the button that switches automatic flaps"),
    ("reset", "Press the button that goes back to the start"),
)
"""Function and what the user is asked to do; every one can be left out."""
_CLEAR_MOVE = 0.5


def find_axis(rest: DeviceState, moved: DeviceState, *, taken: Sequence[int] = ()) -> tuple[int, bool] | None:
    """Which axis was moved.

    Args:
        rest: The device before.
        moved: The device while it is held.
        taken: Axes that have a control already.

    Returns:
        Number of the axis and whether it must be reversed to be positive now; None where none moved clearly.
    """
    changes = {
        number: after - before
        for number, (before, after) in enumerate(zip(rest.axes, moved.axes, strict=False))
        if number not in taken
    }
    if not changes:
        return None
    number = max(changes, key=lambda each: abs(changes[each]))
    return (number, changes[number] < 0.0) if abs(changes[number]) >= _CLEAR_MOVE else None


def springs_back(released: DeviceState, number: int) -> bool:
    """Whether an axis returns to its centre by itself when it is let go.

    Args:
        released: The device after the axis was let go.
        number: The axis.
    """
    return abs(released.axes[number]) < 0.2


def find_button(rest: DeviceState, pressed: DeviceState, *, taken: Sequence[int] = ()) -> int | None:
    """Which button was pressed.

    Args:
        rest: The device before.
        pressed: The device while it is held.
        taken: Buttons that have a function already.
    """
    new = sorted(pressed.buttons - rest.buttons - set(taken))
    return new[0] if new else None


def make_map(
    device: str, axes: dict[str, tuple[int, bool]], buttons: dict[DeviceFunction, int], *, lever_springs: bool
) -> GamepadMap:
    """Put a map together.

    Args:
        device: Name of the device.
        axes: Axis number and reversal by control; ``stick`` must be there.
        buttons: Button numbers by function.
        lever_springs: Whether the lever axis springs back, so that it must move the lever instead of being it.
    """

    def axis(control: str) -> DeviceAxis | None:
        found = axes.get(control)
        return DeviceAxis(index=found[0], reverse=found[1]) if found else None

    stick, lever = axes["stick"], axes.get("lever")
    return GamepadMap(
        kind="gamepad",
        name=device[:100],
        match=[device[:100]],
        axes=DeviceAxes(
            stick=DeviceAxis(index=stick[0], reverse=stick[1], expo=0.3),
            lateral=axis("lateral"),
            yaw=axis("yaw"),
            lever=LeverAxis(
                index=lever[0],
                reverse=lever[1],
                mode="rate" if lever_springs else "absolute",
                dead_band=0.08 if lever_springs else 0.0,
            )
            if lever
            else None,
        ),
        buttons=buttons,
    )


def map_text(stick_map: GamepadMap) -> str:
    """A map as TOML.

    Args:
        stick_map: The map.
    """
    lines = [
        "# Made by: rtsim joystick --wizard. Use it with: rtsim joystick --map THIS_FILE",
        f"format = {stick_map.format}",
        'kind = "gamepad"',
        f"name = {_quoted(stick_map.name)}",
        f"match = [{', '.join(_quoted(part) for part in stick_map.match)}]",
    ]
    for control in ("stick", "lateral", "yaw", "lever"):
        axis = getattr(stick_map.axes, control)
        if axis is not None:
            lines += ["", f"[axes.{control}]"]
            lines += [f"{key} = {_toml(value)}" for key, value in axis.model_dump().items()]
    for table in ("buttons", "hat_buttons"):
        values = getattr(stick_map, table)
        if values:
            lines += ["", f"[{table}]", *(f"{key} = {_toml(value)}" for key, value in values.items())]
    return "\n".join(lines) + "\n"


def write_map(stick_map: GamepadMap, path: str | os.PathLike[str]) -> None:
    """Write a map; the file is whole or not there.

    Args:
        stick_map: The map.
        path: Where to.

    Raises:
        OutputError: It cannot be written.
    """
    write_whole(path, map_text(stick_map))


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return _quoted(value) if isinstance(value, str) else repr(value)
