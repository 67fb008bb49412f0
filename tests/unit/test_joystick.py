"""Stick maps, the mapping from device to MANUAL_CONTROL, the wizard's findings, the keyboard on a real terminal."""

from __future__ import annotations

import math
import os
import pty
import socket
import termios
import time
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from rtsim.errors import InputError, OutputError
from telemetry.exchange.endpoint import Endpoint
from telemetry.joystick.keyboard import KEYBOARD_MAP, Keyboard
from telemetry.joystick.mapping import Controls, DeviceState, Mapper, axis_value, function_words
from telemetry.joystick.screen import bar, picture
from telemetry.joystick.sender import Sender, VehicleView
from telemetry.joystick.stick_map import (
    DeviceAxis,
    DeviceFunction,
    GamepadMap,
    VehicleMap,
    gamepad_map_for,
    load_gamepad_map,
    load_stick_map,
    load_vehicle_map,
    map_names,
    parse_stick_map,
)
from telemetry.joystick.wizard import find_axis, find_button, make_map, map_text, springs_back, write_map
from telemetry.mavlink.pilot_input import STANDARD_AXES, STANDARD_BUTTONS

XBOX = load_gamepad_map("xbox")


@pytest.mark.parametrize("name", map_names())
def test_every_shipped_map_is_right(name):
    found = load_stick_map(name)
    if isinstance(found, GamepadMap):
        assert found.match
        assert {"nacelle_aft", "nacelle_forward"} <= set(found.buttons)
        assert len(set(found.buttons.values())) == len(found.buttons)
        indices = [axis.index for axis in (found.axes.stick, found.axes.lateral, found.axes.yaw, found.axes.lever)]
        assert len(set(indices)) == 4


def test_the_standard_map_says_what_the_vehicle_does():
    found = load_vehicle_map("mavlink")
    assert {str(control): axis for control, axis in found.axes.items()} == STANDARD_AXES
    assert {str(function): bit for function, bit in found.buttons.items()} == STANDARD_BUTTONS
    assert (found.shape, found.nacelle) == (VehicleMap().shape, VehicleMap().nacelle)


@pytest.mark.parametrize(
    ("device", "name"),
    [
        ("Xbox Wireless Controller", "xbox"),
        ("Microsoft X-Box 360 pad", "xbox"),
        ("Wireless Controller", "playstation"),
        ("Sony Interactive Entertainment Wireless Controller", "playstation"),
        ("Nintendo Switch Pro Controller", "switch_pro"),
        ("Logitech Extreme 3D", "extreme_3d"),
        ("Thrustmaster T.16000M", "t16000m"),
        ("OpenTX Radiomaster TX16S Joystick", "transmitter"),
    ],
)
def test_maps_are_found_by_the_device_name(device, name):
    assert gamepad_map_for(device)[0] == name


def test_an_unknown_device_has_no_map():
    assert gamepad_map_for("Toaster") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind = ", "not valid TOML"),
        ('kind = "boat"', "vehicle, gamepad"),
        ('kind = "vehicle"\nfromat = 1', "perhaps 'format' is meant"),
        ('kind = "vehicle"\n[shape]\nexpo = 2.0', r"shape\.expo"),
        ('kind = "vehicle"\n[shape]\nexpo = "much"', r"shape\.expo"),
        ('kind = "vehicle"\n[axes]\nstick = "w"', r"axes\.stick"),
        ('kind = "vehicle"\n[buttons]\nfire = 1', "fire"),
        ('kind = "vehicle"\n[buttons]\npilot = 40', r"buttons\.pilot: is out of range.*at most 31"),
        ('kind = "vehicle"\n[axes]\nstick = "-z"', r"axes\.lever.*axes\.stick too"),
        ('kind = "vehicle"\n[buttons]\ntrim_aft = 5', r"buttons\.trim_aft.*buttons\.nacelle_forward too"),
        ('kind = "gamepad"\nname = "x"\n[axes]\nstick = {index = 1}\nlever = {index = 1}', r"axes\.stick too"),
        ('kind = "gamepad"\nname = "x"\n[axes]\nstick = {index = 1}\n[buttons]\narm = 3\nreset = 3', "arm too"),
        ('kind = "gamepad"\nname = "x"', "axes"),
        ('kind = "gamepad"\nname = "x"\n[axes.stick]\nindx = 1', "index"),
    ],
)
def test_wrong_maps_are_told_in_one_sentence(text, words):
    with pytest.raises(InputError, match=words):
        raise parse_stick_map(text, file="map.toml")


def test_maps_of_the_other_kind_are_refused(tmp_path):
    with pytest.raises(InputError, match="rtsim joystick --map"):
        load_vehicle_map("xbox")
    with pytest.raises(InputError, match="rtsim fly --stick-map"):
        load_gamepad_map("mavlink")
    with pytest.raises(InputError, match="xbox"):
        load_stick_map("no_such_map")
    with pytest.raises(InputError, match="does not exist"):
        load_stick_map(tmp_path / "none.toml")


def test_axes_and_buttons_become_manual_control():
    mapper = Mapper(XBOX, lever=0.4)
    state = DeviceState((0.5, 0.0, -1.0, -0.6, -1.0, -1.0), frozenset({4}), (1, 0))
    controls = mapper.controls(state, 0.02)
    x, y, z, r, buttons, more = controls.manual_control()
    assert x == 1000  # the stick pushed away from the body is -1 at the device and forward here
    assert -600 < y < -200
    assert z == 400
    assert 200 < r < 500
    assert buttons == 1 << 4 | 1 << 11  # nacelle aft, and trim forward from the cross
    assert more == 0


@pytest.mark.parametrize("name", ["extreme_3d", "t16000m"])
def test_a_cross_with_room_trims_to_both_sides(name):
    mapper = Mapper(load_gamepad_map(name))
    sent = {right: mapper.controls(DeviceState((0.0,) * 4, hat=(right, 0)), 0.02).manual_control() for right in (-1, 1)}
    assert {right: buttons[4:] for right, buttons in sent.items()} == {-1: (0, 1), 1: (0, 2)}


def test_a_lever_that_springs_back_moves_the_lever():
    mapper = Mapper(XBOX, lever=0.4)
    for _ in range(50):
        mapper.controls(DeviceState((0.0, -1.0, 0.0, 0.0, 0.0, 0.0)), 0.02)
    assert mapper.lever == pytest.approx(0.7)
    for _ in range(200):
        mapper.controls(DeviceState((0.0, -1.0, 0.0, 0.0, 0.0, 0.0)), 0.02)
    assert mapper.lever == 1.0
    mapper.controls(DeviceState((0.0,) * 6, frozenset(), (0, -1)), 0.1)
    assert mapper.lever == pytest.approx(1.0 - 0.015)


def test_a_lever_that_stays_is_the_lever():
    mapper = Mapper(load_gamepad_map("extreme_3d"))
    for axis, lever in ((1.0, 0.0), (0.0, 0.5), (-1.0, 1.0)):
        assert mapper.controls(DeviceState((0.0, 0.0, 0.0, axis)), 0.02).lever == pytest.approx(lever)


def test_functions_without_a_bit_are_told_once():
    mapper = Mapper(XBOX)
    state = DeviceState((0.0,) * 6, frozenset({7}))
    assert mapper.controls(state, 0.02).pressed == {"arm"}
    assert mapper.controls(state, 0.02).pressed == set()
    assert mapper.controls(state, 0.02).buttons == 0


def test_missing_and_broken_axes_are_centred():
    assert axis_value(DeviceAxis(index=7), DeviceState((0.5,))) == 0.0
    assert axis_value(None, DeviceState((0.5,))) == 0.0
    assert axis_value(DeviceAxis(index=0), DeviceState((float("nan"),))) == 0.0


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.3), st.floats(0.0, 1.0), st.booleans())
def test_axis_shape_is_odd_and_reaches_its_ends(value, dead_band, expo, reverse):
    axis = DeviceAxis(index=0, dead_band=dead_band, expo=expo, reverse=reverse)
    there, back = axis_value(axis, DeviceState((value,))), axis_value(axis, DeviceState((-value,)))
    assert there == -back
    assert abs(there) <= 1.0
    assert abs(axis_value(axis, DeviceState((1.0,)))) == pytest.approx(1.0)


def test_every_function_is_described():
    functions = {name for part in get_args(DeviceFunction) for name in (get_args(part) or (part,))}
    assert set(function_words()) == functions
    assert all(function_words().values())


def test_the_wizard_finds_axes_directions_and_buttons():
    rest = DeviceState((0.0, 0.05, -1.0, 0.0), frozenset({9}))
    assert find_axis(rest, DeviceState((0.1, -0.9, -1.0, 0.0))) == (1, True)
    assert find_axis(rest, DeviceState((0.1, 0.0, 0.9, 0.0))) == (2, False)
    assert find_axis(rest, DeviceState((0.1, -0.9, -1.0, 0.0)), taken=[1]) is None
    assert find_axis(rest, DeviceState((0.3, 0.0, -1.0, 0.0))) is None
    assert find_button(rest, DeviceState(buttons=frozenset({9, 4}))) == 4
    assert find_button(rest, DeviceState(buttons=frozenset({9}))) is None
    assert springs_back(DeviceState((0.0, 0.1)), 1)
    assert not springs_back(DeviceState((0.0, -1.0)), 1)


def test_the_wizards_file_reads_back_and_flies(tmp_path):
    made = make_map(
        'Odd "Pad" ü',
        {"stick": (1, True), "lever": (2, False), "yaw": (0, False)},
        {"nacelle_aft": 3, "arm": 9},
        lever_springs=False,
    )
    file = tmp_path / "mine.toml"
    write_map(made, file)
    assert load_gamepad_map(file) == made
    assert parse_stick_map(map_text(XBOX), file="x") == XBOX
    assert Mapper(made).controls(DeviceState((0.0, -1.0, 1.0)), 0.02).manual_control()[:3] == (1000, 0, 1000)
    assert list(tmp_path.iterdir()) == [file]
    with pytest.raises(OutputError, match="cannot be written"):
        write_map(made, tmp_path / "none" / "mine.toml")


@pytest.fixture(name="terminal")
def _terminal():
    master, slave = pty.openpty()
    keyboard = Keyboard(slave)
    yield master, keyboard
    keyboard.close()
    os.close(master)
    os.close(slave)


def press(master, keyboard, keys, mapper):
    os.write(master, keys.encode())
    time.sleep(0.01)
    return mapper.controls(keyboard.read(), 0.02)


def test_keys_move_sticks_lever_and_nacelles(terminal):
    master, keyboard = terminal
    mapper = Mapper(KEYBOARD_MAP, lever=0.5)
    assert press(master, keyboard, "w", mapper).stick == pytest.approx(0.35)
    assert press(master, keyboard, "\x1b[B", mapper).stick == pytest.approx(0.0)  # both at once
    assert press(master, keyboard, "m", mapper).buttons == 1 << 5
    time.sleep(0.2)
    controls = mapper.controls(keyboard.read(), 0.02)
    assert controls.stick == 0.0
    assert controls.buttons == 1 << 5  # held until repeats could have come
    assert press(master, keyboard, "o", mapper).pressed == {"arm"}
    assert not keyboard.finished
    press(master, keyboard, "x", mapper)
    assert keyboard.finished


@pytest.mark.parametrize(
    ("keys", "y", "r"),
    [("d", 1, 0), ("a", -1, 0), ("\x1b[C", 1, 0), ("\x1bOD", -1, 0), ("e", 0, 1), ("q", 0, -1), ("aq", -1, -1)],
)
def test_keys_move_lateral_stick_and_pedals(terminal, keys, y, r):
    master, keyboard = terminal
    controls = press(master, keyboard, keys, Mapper(KEYBOARD_MAP))
    assert (controls.lateral, controls.yaw) == (y * 0.35, r * 0.35)
    assert controls.manual_control()[1] == y * 350
    assert controls.manual_control()[3] == r * 350
    assert controls.stick == 0.0


def test_keys_trim_to_both_sides(terminal):
    master, keyboard = terminal
    assert press(master, keyboard, ",", Mapper(KEYBOARD_MAP)).manual_control()[4:] == (0, 1)
    time.sleep(0.2)
    assert press(master, keyboard, ".", Mapper(KEYBOARD_MAP)).manual_control()[4:] == (0, 2)


def test_lever_keys_are_exact_steps(terminal):
    master, keyboard = terminal
    levers = []
    for keys in ("r", "rr", "R", "f"):
        os.write(master, keys.encode())
        time.sleep(0.03)
        levers.append(keyboard.read().lever_steps)
    assert levers == pytest.approx([0.01, 0.02, 0.05, -0.01])


def test_the_terminal_is_put_back():
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    keyboard = Keyboard(slave)
    assert termios.tcgetattr(slave) != before
    keyboard.close()
    assert termios.tcgetattr(slave) == before
    os.close(master)
    os.close(slave)


def test_a_terminal_that_got_another_mode_gives_keys_again(terminal):
    """As after Ctrl-Z and ``fg``."""
    master, keyboard = terminal
    slave = keyboard._descriptor
    canonical = termios.tcgetattr(slave)
    canonical[3] |= termios.ICANON | termios.ECHO
    termios.tcsetattr(slave, termios.TCSANOW, canonical)
    os.write(master, b"x")
    end = time.monotonic() + 30.0
    while not keyboard.finished and time.monotonic() < end:
        keyboard.read()
    assert keyboard.finished


def test_without_a_terminal_there_is_no_keyboard():
    read, write = os.pipe()
    with pytest.raises(InputError, match="terminal"):
        Keyboard(read)
    os.close(read)
    os.close(write)


def test_bars():
    assert bar(0.0, centred=True).index("#") == 20
    assert bar(1.0, centred=True).endswith("#")
    assert bar(0.0, centred=False).startswith("#")
    assert len(bar(7.0, centred=True)) == len(bar(-7.0, centred=False)) == 41


def test_the_picture_says_what_matters():
    from rich.console import Console

    console = Console(width=120, record=True, file=open(os.devnull, "w"))  # noqa: PTH123, SIM115
    view = VehicleView()
    console.print(picture(Controls(), view, device="Pad", rate_hz=50.0))
    view.system_id, view.heard, view.custom_mode = 1, time.monotonic(), 0x00070000
    view.values |= {"nac_deg": 75.0, "airspeed_kt": 80.0, "bank_deg": -12.0, "heading_deg": 270.0}
    view.texts = ["Corridor clear"]
    console.print(picture(Controls(stick=0.5), view, device="Pad", rate_hz=50.0))
    view.heard = 0.0
    console.print(picture(Controls(), view, device="Pad", rate_hz=50.0))
    text = console.export_text()
    console.file.close()
    for words in (
        "Waiting for a vehicle",
        "Stabilized",
        "nacelle 75.0 deg",
        "airspeed 80 kn",
        "bank -12 deg",
        "heading 270 deg",
        "Corridor clear",
        "silent",
    ):
        assert words in text


class Vehicle:
    """Any MAVLink vehicle: a heartbeat, channels, and ears."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.5)
        self.to = ("127.0.0.1", port)
        self.encoder, self.decoder = dialect.MAVLink(None, srcSystem=7, srcComponent=1), dialect.MAVLink(None)

    def send(self, message):
        self.socket.sendto(message.pack(self.encoder), self.to)
        time.sleep(0.01)

    def take(self):
        return self.decoder.decode(bytearray(self.socket.recv(2048)))


@pytest.fixture(name="air")
def _air():
    sender = Sender(listen=Endpoint("127.0.0.1", 0), connect=None)
    vehicle = Vehicle(sender.port)
    yield sender, vehicle
    sender.close()
    vehicle.socket.close()


BEAT = dialect.MAVLink_heartbeat_message(2, 3, 0x80, 0, 4, 3)


def test_the_sender_finds_any_vehicle_and_flies_it(air):
    sender, vehicle = air
    sender.fly(Controls())
    assert sender.sent == 0
    vehicle.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))  # a ground station is no vehicle
    sender.poll()
    assert sender.vehicle.system_id == 0
    vehicle.send(BEAT)
    sender.poll()
    assert vehicle.take().type == dialect.MAV_TYPE_GCS
    assert not sender.knows_lever
    channels = [1500, 1500, 1730, *[1500] * 5, *[65535] * 10]
    vehicle.send(dialect.MAVLink_rc_channels_message(1, 8, *channels, 100))
    sender.poll()
    assert sender.knows_lever
    assert sender.vehicle.applied_lever == pytest.approx(0.73)
    sender.fly(Controls(stick=-0.5, lever=0.25, buttons=1 << 5, pressed=frozenset({"arm", "reset"})))
    command, parameter, sticks = vehicle.take(), vehicle.take(), vehicle.take()
    assert (command.command, command.param1, command.target_system) == (400, 0.0, 7)  # it was armed
    assert (parameter.param_id, parameter.param_value) == ("XV_RESET", 1.0)
    assert (sticks.target, sticks.x, sticks.z, sticks.buttons) == (7, -500, 250, 1 << 5)


def test_the_sender_keeps_the_attitude_in_degrees(air):
    sender, vehicle = air
    vehicle.send(BEAT)
    sender.poll()
    vehicle.send(dialect.MAVLink_attitude_message(1, math.radians(-12.0), 0.1, -math.pi / 2.0, 0.0, 0.0, 0.0))
    sender.poll()
    assert sender.vehicle.values["bank_deg"] == pytest.approx(-12.0, abs=1e-4)
    assert sender.vehicle.values["heading_deg"] == pytest.approx(270.0, abs=1e-4)


def test_the_sender_waits_for_the_lever_as_long_as_it_takes(air, monkeypatch):
    """The joystick may be started minutes before the flight has its first frame; it asks, and sends no sticks."""
    sender, vehicle = air
    for minute in range(3):
        monkeypatch.setattr(sender, "_beat", -1e9)
        vehicle.send(BEAT)
        sender.poll()
        monkeypatch.setattr(sender.vehicle, "heard", sender.vehicle.heard - 60.0 * minute)
        assert not sender.knows_lever
        assert vehicle.take().get_type() == "HEARTBEAT"
        if minute == 0:
            continue  # it may be telling anyway
        asked = vehicle.take()
        assert (asked.get_type(), asked.command, asked.param1) == ("COMMAND_LONG", 512, 65.0)


def test_a_lever_without_a_place_follows_the_vehicle_while_nobody_moves_it(air):
    from rtsim.cli.joystick import _follow_lever

    sender, vehicle = air
    mapper = Mapper(KEYBOARD_MAP)
    vehicle.send(BEAT)
    vehicle.send(dialect.MAVLink_rc_channels_message(1, 8, 1500, 1500, 1730, *[1500] * 5, *[65535] * 10, 100))
    sender.poll()
    _follow_lever(mapper, sender)
    assert mapper.controls(DeviceState(), 0.02).lever == pytest.approx(0.73)
    sender.fly(mapper.controls(DeviceState(lever_steps=0.1), 0.02))
    _follow_lever(mapper, sender)
    assert mapper.lever == pytest.approx(0.83)
    for _ in range(100):
        mapper.controls(DeviceState(), 0.02)
    _follow_lever(mapper, sender)
    assert mapper.lever == pytest.approx(0.83)  # any vehicle: its channels may be those of a radio
    vehicle.send(dialect.MAVLink_named_value_float_message(1, b"nac_deg", 90.0))
    sender.poll()
    _follow_lever(mapper, sender)
    assert mapper.lever == pytest.approx(0.73)


@pytest.mark.parametrize("calls", [True, False])
def test_only_the_vehicle_that_was_called_or_found_is_flown(calls):
    """Heartbeats with its id from another address neither get the sticks nor answers."""
    vehicle, stranger = Vehicle(0), Vehicle(0)
    here = Endpoint(*vehicle.socket.getsockname())
    sender = Sender(listen=None, connect=here) if calls else Sender(listen=Endpoint("127.0.0.1", 0), connect=None)
    vehicle.to = stranger.to = ("127.0.0.1", sender.port)
    stranger.socket.settimeout(0.05)
    if calls:
        stranger.send(BEAT)
        sender.poll()
        assert sender.vehicle.system_id == 0
        assert vehicle.take().get_type() == "HEARTBEAT"
    vehicle.send(BEAT)
    sender.poll()
    for _ in range(3):
        stranger.send(BEAT)
        stranger.send(dialect.MAVLink_rc_channels_message(1, 8, 1500, 1500, 1000, *[1500] * 5, *[65535] * 10, 100))
        stranger.send(dialect.MAVLink_ping_message(1, 1, 0, 0))
    sender.poll()
    assert sender.vehicle.address == vehicle.socket.getsockname()
    assert sender.vehicle.applied_lever is None
    sender.fly(Controls())
    with pytest.raises(TimeoutError):
        stranger.take()
    vehicle.send(dialect.MAVLink_ping_message(5, 6, 0, 0))
    sender.poll()
    while (answer := vehicle.take()).get_type() != "PING":
        pass
    assert (answer.time_usec, answer.seq, answer.target_system) == (5, 6, 7)
    sender.close()
    for end in (vehicle, stranger):
        end.socket.close()


def test_what_the_vehicle_says_is_kept(air):
    sender, vehicle = air
    vehicle.send(BEAT)
    vehicle.send(dialect.MAVLink_vfr_hud_message(51.4444, 50.0, 0, 50, 120.0, 1.0))
    vehicle.send(dialect.MAVLink_named_value_float_message(1, b"nac_deg", 60.0))
    for number in range(20):
        vehicle.send(dialect.MAVLink_statustext_message(6, f"text {number}".encode()))
    sender.poll()
    assert sender.vehicle.values["airspeed_kt"] == pytest.approx(100.0, abs=0.01)
    assert sender.vehicle.values["nac_deg"] == 60.0
    assert sender.vehicle.texts[-1] == "text 19"
    assert len(sender.vehicle.texts) <= 6


def test_a_taken_port_is_told(air):
    with pytest.raises(InputError, match="--listen"):
        Sender(listen=Endpoint("127.0.0.1", air[0].port), connect=None)
