"""``rtsim joystick``: a gamepad or the keyboard as MAVLink sticks, for people without a ground station."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.output import console, emit_json, results
from rtsim.errors import InputError
from rtsim.whole_file import check_writable

if TYPE_CHECKING:
    from telemetry.joystick.gamepad import Gamepad
    from telemetry.joystick.mapping import Device, Mapper
    from telemetry.joystick.sender import Sender
    from telemetry.joystick.stick_map import GamepadMap

_LISTEN = "127.0.0.1:14550"
_SCREEN_HZ = 10.0
_LEVER_REST_S = 1.0
HOLD_MODE = 0x03040000
"""PX4's number of the mode in which the virtual pilot flies."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("joystick")(joystick_command)


def joystick_command(
    *,
    keyboard: Annotated[bool, typer.Option("--keyboard", help="Fly with the keyboard of this terminal.")] = False,
    device: Annotated[
        str | None, typer.Option(help="Number of the gamepad, or a part of its name.", show_default="the first")
    ] = None,
    stick_map: Annotated[
        str | None, typer.Option("--map", help="Gamepad map: a name or a .toml file.", show_default="the one that fits")
    ] = None,
    listen: Annotated[str | None, typer.Option(help="Wait for a vehicle on HOST:PORT.", show_default=_LISTEN)] = None,
    connect: Annotated[
        str | None, typer.Option(help="Call the vehicle at HOST:PORT instead of waiting.", show_default="it waits")
    ] = None,
    rate: Annotated[float, typer.Option(help="Messages per second [Hz].", min=5.0, max=200.0)] = 50.0,
    wizard: Annotated[
        Path | None,
        typer.Option(help="Find out what your device's axes and buttons are, and write FILE.", show_default="none"),
    ] = None,
    list_devices: Annotated[bool, typer.Option("--list", help="List gamepads and maps, then end.")] = False,
    duration: Annotated[float | None, typer.Option(help="End after so many seconds.", show_default="at Ctrl-C")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout at the end.")] = False,
) -> None:
    """Fly a MAVLink vehicle with a gamepad or the keyboard: MANUAL_CONTROL at 50 Hz.

    Start the aircraft first, in another terminal: rtsim fly manual_flight --pilot mavlink

    Examples:
        rtsim joystick  # the first gamepad
        rtsim joystick --keyboard  # the keys of this terminal
        rtsim joystick --wizard mine.toml  # find out the axes of an unknown device
    """
    from telemetry.exchange.endpoint import Endpoint
    from telemetry.joystick.sender import Sender

    if list_devices:
        _list(json=json)
        return
    if wizard is not None:
        _run_wizard(wizard, device)
        return
    if listen is not None and connect is not None:
        raise InputError("cannot be used together with --connect", key="--listen", mend="leave one of them out")
    waiting = None if connect else Endpoint.parse(listen or _LISTEN, key="--listen")
    calling = Endpoint.parse(connect, key="--connect") if connect else None
    opened, mapping = _open_device(keyboard=keyboard, wanted=device, map_name=stick_map)
    sent, vehicle = 0, 0
    try:
        sender = Sender(listen=waiting, connect=calling)
        where = f"calling {calling}" if calling else f"waiting on {waiting}"
        console.print(f"{opened.name}, map {mapping.name}: {where}. Ctrl-C ends.", markup=False)
        if keyboard:
            _print_keys()
        try:
            _fly(opened, mapping, sender, rate_hz=rate, duration=duration)
        except KeyboardInterrupt:
            console.print("Ended.")
        finally:
            sender.close()
            sent, vehicle = sender.sent, sender.vehicle.system_id
    finally:
        opened.close()
    if json:
        emit_json({"device": opened.name, "map": mapping.name, "sent": sent, "vehicle": vehicle})


def _open_device(*, keyboard: bool, wanted: str | None, map_name: str | None) -> tuple[Device, GamepadMap]:
    from telemetry.joystick.stick_map import gamepad_map_for, load_gamepad_map, map_names

    if keyboard:
        from telemetry.joystick.keyboard import KEYBOARD_MAP, Keyboard

        if map_name is not None:
            raise InputError("the keyboard has its own map", key="--map", mend="leave it out")
        return Keyboard(), KEYBOARD_MAP
    from telemetry.joystick.gamepad import Gamepad

    chosen = load_gamepad_map(map_name) if map_name is not None else None
    gamepad = Gamepad(wanted)
    if chosen is not None:
        return gamepad, chosen
    found = gamepad_map_for(gamepad.name)
    if found is None:
        gamepad.close()
        raise InputError(
            "there is no map for this device",
            key="--map",
            value=gamepad.name,
            allowed=", ".join(name for name in map_names() if name != "mavlink"),
            mend="choose one that fits, or make one: rtsim joystick --wizard mine.toml",
        )
    return gamepad, found[1]


def _fly(device: Device, stick_map: GamepadMap, sender: Sender, *, rate_hz: float, duration: float | None) -> None:
    """Read, map, send, on a fixed schedule; the picture ten times a second."""
    from rich.live import Live

    from telemetry.joystick.mapping import Mapper
    from telemetry.joystick.screen import picture

    mapper = Mapper(stick_map)
    period = 1.0 / rate_hz
    start = due = time.monotonic()
    shown = 0.0
    with Live(console=console.real(), auto_refresh=False, transient=True) as screen:
        while duration is None or due - start < duration:
            sender.poll()
            _follow_lever(mapper, sender)
            controls = mapper.controls(device.read(), period)
            if sender.knows_lever:
                sender.fly(controls)
            if due - shown >= 1.0 / _SCREEN_HZ:
                shown = due
                screen.update(picture(controls, sender.vehicle, device=device.name, rate_hz=rate_hz), refresh=True)
                _check_device(device)
            if getattr(device, "finished", False):
                return
            due += period
            time.sleep(max(0.0, due - time.monotonic()))
            due = max(due, time.monotonic() - period)  # a suspended program does not send a burst


def _follow_lever(mapper: Mapper, sender: Sender) -> None:
    """Keep a power lever that has no place of its own where the vehicle has it, whenever nobody moves it.

    Any vehicle's until we fly; later only that of ours, whose RC_CHANNELS say what acts and not what a radio sends.
    """
    vehicle = sender.vehicle
    if vehicle.applied_lever is None or not vehicle.present:
        return
    rests = "nac_deg" in vehicle.values and mapper.lever_rest_s > _LEVER_REST_S
    if sender.sent == 0 or rests or vehicle.custom_mode == HOLD_MODE:
        mapper.lever = vehicle.applied_lever


def _check_device(device: Device) -> None:
    if not getattr(device, "connected", True):
        raise InputError("the gamepad was unplugged", key="--device", value=device.name, mend="plug it in, start again")


def _print_keys() -> None:
    from telemetry.joystick.keyboard import KEY_HELP

    for keys, meaning in KEY_HELP:
        console.print(f"  {keys:<18} {meaning}", markup=False)


def _list(*, json: bool) -> None:
    from telemetry.joystick.gamepad import gamepad_names
    from telemetry.joystick.stick_map import gamepad_map_for, load_stick_map, map_names

    devices: list[dict[str, Any]] = []
    for number, name in enumerate(gamepad_names()):
        found = gamepad_map_for(name)
        devices.append({"number": number, "name": name, "map": found[0] if found else None})
    if json:
        emit_json({"devices": devices, "maps": map_names()})
        return
    results.print("Gamepads:" if devices else "No gamepad is plugged in.")
    for entry in devices:
        results.print(
            f"  {entry['number']}: {entry['name']} (map {entry['map'] or 'none, use --wizard'})", markup=False
        )
    results.print("Maps:")
    for name in map_names():
        results.print(f"  {name:<22} {getattr(load_stick_map(name), 'name', 'vehicle side')}", markup=False)


def _run_wizard(path: Path, wanted: str | None) -> None:
    """Ask for one movement after the other and write the map."""
    from telemetry.joystick.gamepad import Gamepad
    from telemetry.joystick.wizard import AXIS_QUESTIONS, BUTTON_QUESTIONS, make_map, springs_back, write_map

    if path.suffix != ".toml":
        raise InputError("must end in .toml", key="--wizard", value=str(path), mend="name it FILE.toml")
    check_writable(path)
    gamepad = Gamepad(wanted)
    try:
        console.print(f"{gamepad.name}: let everything go.", markup=False)
        time.sleep(1.0)
        axes: dict[str, tuple[int, bool]] = {}
        springs = True
        for control, question in AXIS_QUESTIONS:
            found = _ask_axis(gamepad, question, taken=[number for number, _ in axes.values()])
            if found is None and control == "stick":
                raise InputError("no axis moved", key="--wizard", mend="push the stick all the way, start again")
            if found is not None:
                axes[control] = found
                console.print(f"  axis {found[0]}{', reversed' if found[1] else ''}. Let it go.", markup=False)
                time.sleep(1.5)
                if control == "lever":
                    springs = springs_back(gamepad.read(), found[0])
        buttons: dict[Any, int] = {}
        for function, question in BUTTON_QUESTIONS:
            number = _ask_button(gamepad, question, taken=list(buttons.values()))
            if number is not None:
                buttons[function] = number
                console.print(f"  button {number}.", markup=False)
        write_map(make_map(gamepad.name, axes, buttons, lever_springs=springs), path)
    finally:
        gamepad.close()
    results.print(f"Wrote {path}. Fly with: rtsim joystick --map {path}", markup=False)


def _ask_axis(gamepad: Gamepad, question: str, *, taken: list[int]) -> tuple[int, bool] | None:
    """Wait up to eight seconds for a clear movement that lasts a third of a second."""
    from telemetry.joystick.wizard import find_axis

    console.print(f"{question} (wait to leave it out).", markup=False)
    rest, since, last = gamepad.read(), 0.0, None
    end = time.monotonic() + 8.0
    while time.monotonic() < end:
        found = find_axis(rest, gamepad.read(), taken=taken)
        if found is None or found != last:
            last, since = found, time.monotonic()
        elif time.monotonic() - since > 0.33:
            return found
        time.sleep(0.02)
    return None


def _ask_button(gamepad: Gamepad, question: str, *, taken: list[int]) -> int | None:
    """Wait up to six seconds for a button."""
    from telemetry.joystick.wizard import find_button

    console.print(f"{question} (wait to leave it out).", markup=False)
    rest, end = gamepad.read(), time.monotonic() + 6.0
    while time.monotonic() < end:
        number = find_button(rest, gamepad.read(), taken=taken)
        if number is not None:
            return number
        time.sleep(0.02)
    return None
