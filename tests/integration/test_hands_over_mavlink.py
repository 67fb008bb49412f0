"""A whole flight by hand over UDP: started sticks move nothing, a stopped flight is told, a freeze is an event."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import COLUMN
from rtsim.processes import safe_environment
from scenarios.flight.replay import replay_log
from telemetry.log.reader import read_log


class Ground:
    """A ground station that flies with whatever a test says."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.encoder, self.decoder = dialect.MAVLink(None, srcSystem=255, srcComponent=190), dialect.MAVLink(None)
        self.vehicle, self.last, self.texts = None, {}, []

    def poll(self):
        while True:
            try:
                data, self.vehicle = self.socket.recvfrom(4096)
            except BlockingIOError:
                return
            message = self.decoder.decode(bytearray(data))
            self.last[message.get_type()] = message
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)

    def send(self, *messages):
        for message in messages:
            self.socket.sendto(message.pack(self.encoder), self.vehicle)

    def until(self, condition, *messages, timeout_s=30.0):
        """Poll, and send messages 50 times a second, until a condition holds."""
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, (self.texts, self.last.keys())
            self.poll()
            if self.vehicle is not None:
                self.send(*messages)
            time.sleep(0.02)

    def hold(self, seconds, *messages):
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, *messages)


def sticks(x=0, z=500, buttons=0, y=0, r=0):
    return dialect.MAVLink_manual_control_message(1, x, y, z, r, buttons)


OVERRIDE = dialect.MAVLink_rc_channels_override_message(1, 1, *[65535] * 8, *[1500] * 10)


@pytest.mark.slow
def test_sticks_from_the_first_moment_on_and_a_flight_that_stops(tmp_path):
    ground = Ground()
    log = tmp_path / "flight.parquet"
    flight = subprocess.Popen(
        [
            *(sys.executable, "-m", "rtsim", "fly", "manual_flight", "--pilot", "mavlink", "--headless", "--json"),
            *("--duration", "60", "--log", str(log), "--mavlink", f"127.0.0.1:{ground.socket.getsockname()[1]}"),
        ],
        env=safe_environment() | {"XDG_CONFIG_HOME": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # A lever of 0.5 that nobody chose, beside overrides that are not ours, from before the first frame on.
        still = (sticks(x=300), OVERRIDE)
        ground.until(lambda: "RC_CHANNELS" in ground.last, *still, timeout_s=150.0)
        ground.hold(3.0, *still)
        channels = ground.last["RC_CHANNELS"]
        assert channels.chan7_raw == 1500  # they fly
        assert channels.chan3_raw > 1650
        assert channels.chan2_raw == 1500
        assert any("Lever stays" in text for text in ground.texts)
        # The hand moves through both.
        ground.hold(0.3, sticks(x=-100, z=800), OVERRIDE)
        ground.hold(0.5, sticks(x=100, z=700), OVERRIDE)
        assert ground.last["RC_CHANNELS"].chan3_raw == pytest.approx(1700, abs=1)
        assert ground.last["RC_CHANNELS"].chan2_raw == pytest.approx(1450, abs=1)
        # Lateral stick and pedals, and back to their centres.
        ground.hold(0.5, sticks(x=100, z=700, y=200, r=-300), OVERRIDE)
        assert ground.last["RC_CHANNELS"].chan1_raw == pytest.approx(1600, abs=1)
        assert ground.last["RC_CHANNELS"].chan4_raw == pytest.approx(1350, abs=1)
        ground.hold(0.3, sticks(z=700), OVERRIDE)
        # A freeze and its end.
        for button in (1 << 7, 0, 1 << 7):
            ground.hold(0.2, sticks(z=700, buttons=button))
        # The process stops: told, not shown as if it flew.
        os.kill(flight.pid, signal.SIGSTOP)
        ground.hold(1.5, sticks(z=700))
        ground.last.clear()
        ground.hold(1.5, sticks(z=700))
        assert ground.last["HEARTBEAT"].system_status == dialect.MAV_STATE_EMERGENCY
        assert "ATTITUDE" not in ground.last
        os.kill(flight.pid, signal.SIGCONT)
        ground.until(lambda: "ATTITUDE" in ground.last, sticks(z=700))
        flight.send_signal(signal.SIGINT)
        output, errors = flight.communicate(timeout=30)
    finally:
        if flight.poll() is None:
            flight.kill()
            flight.communicate()
        ground.socket.close()
    assert json.loads(output.splitlines()[-1])["mavlink"]["faults"] == 0, errors
    flown = read_log(log)
    kinds = [event.kind for event in flown.events]
    assert kinds.count("freeze") == kinds.count("thaw") == 1
    history = flown.history
    first = np.argmax(history[:, COLUMN.pilot_mode] == 1.0)
    assert np.ptp(history[first : first + 500, COLUMN.pilot_lever]) == 0.0
    assert history[:, COLUMN.lateral_stick].max() == 0.2
    assert history[:, COLUMN.pedal].min() == -0.3
    assert replay_log(log).same
