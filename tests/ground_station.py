"""A live flight in its own process, and a small ground station that flies it."""

from __future__ import annotations

import json
import math
import signal
import socket
import subprocess
import sys
import time

import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.processes import safe_environment

KNOT = 1852.0 / 3600.0
FORWARD, AFT = 1 << 5, 1 << 4
"""Buttons that move the nacelles."""


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def turned(angle):
    """An angle between -pi and pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


class Flight:
    """``rtsim fly manual_flight --pilot mavlink`` in its own process."""

    def __init__(self, port, folder, *options):
        self.log = folder / "flight.parquet"
        environment = safe_environment() | {"XDG_CONFIG_HOME": str(folder / "config")}
        self.process = subprocess.Popen(
            [
                *(sys.executable, "-m", "rtsim", "fly", "manual_flight", "--pilot", "mavlink", "--headless", "--json"),
                *("--mavlink", f"127.0.0.1:{port}", "--log", str(self.log), *options),
            ],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def end(self):
        """Stop it if it flies, and give its summary."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        output, errors = self.process.communicate(timeout=20)
        assert output, errors
        return json.loads(output.splitlines()[-1])


class Station:
    """A small ground station."""

    def __init__(self, system=255):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.port = self.socket.getsockname()[1]
        self.vehicle = None
        self.last, self.values, self.heard = {}, {}, []
        self._encoder, self._decoder = dialect.MAVLink(None, srcSystem=system, srcComponent=190), dialect.MAVLink(None)
        self._beat = 0.0

    def send(self, message):
        self.socket.sendto(message.pack(self._encoder), self.vehicle)
        self._encoder.seq = (self._encoder.seq + 1) % 256

    def poll(self):
        """Take what came; a heartbeat goes out once a second."""
        while True:
            try:
                data, self.vehicle = self.socket.recvfrom(4096)
            except BlockingIOError:
                break
            message = self._decoder.decode(bytearray(data))
            name = message.get_type()
            self.last[name] = message
            self.heard.append((time.monotonic(), message))
            if name == "NAMED_VALUE_FLOAT":
                self.values[message.name] = message.value
        if self.vehicle is not None and time.monotonic() - self._beat > 1.0:
            self._beat = time.monotonic()
            self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def wait_for(self, condition, timeout_s=5.0):
        """Poll until a condition holds."""
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, "nothing came of it"
            self.poll()
            time.sleep(0.002)

    def wait_for_flight(self, flight):
        def flies():
            if flight.process.poll() is not None:
                pytest.fail(flight.process.communicate()[1])
            return "ATTITUDE" in self.last and "RC_CHANNELS" in self.last and self.values

        self.wait_for(flies, 150.0)  # the kernels may have to be compiled first

    def since(self, name, moment):
        return [(at, message) for at, message in self.heard if message.get_type() == name and at >= moment]

    def ask_for(self, message, interval_ms):
        """Set the rate of a stream, by the class of its message."""
        self.send(dialect.MAVLink_command_long_message(1, 1, 511, 0, message.id, 1e3 * interval_ms, 0, 0, 0, 0, 0))

    def sticks(self, x=0, z=500, buttons=0, y=0, r=0):
        self.send(dialect.MAVLink_manual_control_message(1, x, y, z, r, buttons))

    def channels(self, *first):
        """Override the first channels and leave the others."""
        values = [*first, *[65535] * (18 - len(first))]
        self.send(dialect.MAVLink_rc_channels_override_message(1, 1, *values))

    def hold(self, seconds, **sticks):
        """Send sticks 50 times a second."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.poll()
            self.sticks(**sticks)
            time.sleep(0.02)

    def close(self):
        self.socket.close()
