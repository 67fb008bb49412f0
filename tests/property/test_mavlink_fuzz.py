"""Six kinds of hostile input against the vehicle: nothing raises, nothing unasked acts, telemetry goes on."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import COLUMN
from telemetry.exchange.ring import ROW_WIDTH
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import Exchange
from telemetry.mavlink.vehicle import Vehicle

GROUND = ("127.0.0.1", 14550)
AIDS = {"rate_damping": True, "attitude_retention": True, "altitude_hold": False, "airspeed_hold": False}
_EXTREMES = {
    "f": (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 0.0, 1.0, -1.0, 1e-40),
    "d": (math.nan, math.inf, 1e300, 0.0),
}
_SIZES = {"b": 8, "h": 16, "i": 32, "q": 64}


def field_values(code):
    """Values of one struct code: its extremes and a random one."""
    if code in _EXTREMES:
        return st.sampled_from(_EXTREMES[code]) | st.floats(width=32, allow_nan=True)
    bits = _SIZES[code.lower()]
    low, high = (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return st.sampled_from([low, high, 0, 1]) | st.integers(low, high)


@st.composite
def valid_frames(draw, numbers=None):
    """A frame with a right checksum of any message, its fields at random or at their extremes."""
    number = draw(st.sampled_from(sorted(numbers or dialect.mavlink_map)))
    message = dialect.mavlink_map[number]
    size = message.unpacker.size
    if draw(st.booleans()):
        payload = draw(st.binary(min_size=size, max_size=size))
    else:
        values = []
        for count, code in _fields(message.unpacker.format):
            if code == "c":
                values += [draw(st.binary(min_size=1, max_size=1))] * count
            elif code == "s":
                values.append(draw(st.binary(max_size=count)))
            else:
                values += [draw(field_values(code))] * count
        payload = message.unpacker.pack(*values)
    payload = payload[: draw(st.integers(0, size))] if draw(st.booleans()) else payload
    return frame_of(number, payload, message.crc_extra, draw(st.sampled_from([255, 245, 42, 1, 0])))


def _fields(layout):
    count = ""
    for letter in layout if isinstance(layout, str) else layout.decode():
        if letter.isdigit():
            count += letter
        elif letter.isalpha():
            yield int(count or 1), letter
            count = ""


def frame_of(number, payload, extra, system):
    body = bytes((len(payload), 0, 0, 7, system, 190)) + struct.pack("<I", number)[:3] + payload
    crc = dialect.x25crc(body + bytes((extra,))).crc
    return b"\xfd" + body + struct.pack("<H", crc)


REQUESTS = {"reset", "pilot", "aid", "flaps", "throttle", "nacelle", "transition", "parameter", "freeze"}


class Target:
    """A vehicle in flight that counts what it sends."""

    def __init__(self):
        self.exchange = Exchange()
        self.sent = []
        self.now = 50.0
        config = MavlinkConfig(aids=AIDS, reboot_resets=True)
        self.vehicle = Vehicle(config, self.exchange, send=lambda data, to: self.sent.append((data, to)), now=self.now)
        self.row = np.zeros((1, ROW_WIDTH))
        self.row[0, COLUMN.nacelle_deg], self.row[0, COLUMN.altitude_m] = 90.0, 100.0
        self.live()

    def live(self):
        """One second of flight; heartbeats and attitude must come."""
        self.sent.clear()
        for _ in range(51):
            self.row[0, COLUMN.time_s] += 0.02
            self.vehicle.observe(self.row, self.now)
            self.vehicle.tick(self.now)
            self.now += 0.02
        decoder = dialect.MAVLink(None)
        names = [decoder.decode(bytearray(data)).get_type() for data, to in self.sent if to == GROUND]
        assert names.count("HEARTBEAT") >= 1
        return names

    def receive(self, data, address=GROUND):
        self.now += 0.01
        self.vehicle.receive(data, address, received_ns=int(self.now * 1e9), now=self.now)

    def check(self):
        """What was let through is finite and in range; the vehicle lives."""
        self.live()
        sticks = self.exchange.read_sticks()
        assert -1.0 <= sticks.stick <= 1.0
        assert 0.0 <= sticks.lever <= 1.0
        assert -1.0 <= sticks.lateral <= 1.0
        assert -1.0 <= sticks.yaw <= 1.0
        assert math.isnan(sticks.nacelle_angle) or 0.0 <= sticks.nacelle_angle <= math.pi / 2 + 1e-9
        for request in self.exchange.take_requests():
            assert math.isfinite(request.value)
            assert request.kind in REQUESTS
        for parameter, value in (self.vehicle.store.at(place) for place in range(len(self.vehicle.store))):
            assert parameter.low <= value <= parameter.high
        assert self.exchange.header[11] == 0

    def close(self):
        self.exchange.close()


@pytest.fixture(name="target", scope="module")
def _target():
    target = Target()
    yield target
    target.close()


@settings(max_examples=150)
@given(data=st.binary(min_size=1, max_size=400))
def test_random_bytes(target, data):
    target.receive(data)
    target.receive(b"\xfd" + data)
    target.receive(b"\xfe" + data)
    target.check()


@settings(max_examples=150)
@given(data=valid_frames(), end=st.integers(1, 300))
def test_truncated_frames(target, data, end):
    target.receive(data[: min(end, len(data) - 1)])
    target.check()


@settings(max_examples=150)
@given(data=valid_frames(), place=st.integers(0, 300), flip=st.integers(1, 255))
def test_changed_bytes(target, data, place, flip):
    changed = bytearray(data)
    changed[place % len(changed)] ^= flip
    target.receive(bytes(changed))
    target.check()


@settings(max_examples=400)
@given(data=st.lists(valid_frames(), min_size=1, max_size=4))
def test_any_valid_message_with_any_content(target, data):
    for each in data:
        target.receive(each)
    target.receive(b"".join(data))
    target.check()


HANDLED = (0, 4, 11, 20, 21, 23, 37, 40, 43, 44, 45, 51, 69, 70, 73, 75, 76, 110, 111)


@settings(max_examples=600)
@given(data=st.lists(valid_frames(HANDLED), min_size=1, max_size=6))
def test_messages_that_act_with_any_content(target, data):
    for each in data:
        target.receive(each)
    target.check()


@settings(max_examples=600)
@given(
    command=st.sampled_from([176, 187, 245, 246, 300, 400, 510, 511, 512, 519, 520, 3000]) | st.integers(0, 65535),
    values=st.lists(field_values("f"), min_size=7, max_size=7),
    target_system=st.sampled_from([0, 1, 2, 255]),
)
def test_commands_with_any_numbers(target, command, values, target_system):
    message = dialect.MAVLink_command_long_message(target_system, 1, command, 0, *values)
    target.sent.clear()
    target.receive(message.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=190)))
    decoder = dialect.MAVLink(None)
    acks = [decoder.decode(bytearray(data)) for data, _ in target.sent]
    acks = [ack for ack in acks if ack.get_type() == "COMMAND_ACK"]
    assert len(acks) == (1 if target_system in {0, 1} else 0)
    target.check()
