"""The MAVLink process from outside: start, end, death and rebirth, a taken port, signing."""

from __future__ import annotations

import os
import signal
import socket
import time

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.errors import InputError, OutputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import Feedback
from telemetry.mavlink.framing import signature_time
from telemetry.mavlink.link import MavlinkLink


class Ground:
    """A socket that hears the vehicle and answers."""

    def __init__(self, key=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.01)
        self.endpoint = Endpoint("127.0.0.1", self.socket.getsockname()[1])
        self.encoder, self.decoder = dialect.MAVLink(None, srcSystem=255, srcComponent=190), dialect.MAVLink(None)
        if key is not None:
            self.encoder.signing.secret_key, self.encoder.signing.sign_outgoing = key, True
            self.encoder.signing.timestamp = signature_time()

    def send(self, message, port):
        self.socket.sendto(message.pack(self.encoder), ("127.0.0.1", port))

    def take(self):
        """Messages that came, and their raw bytes."""
        found = []
        while True:
            try:
                data = self.socket.recv(4096)
            except TimeoutError:
                return found
            found.append((self.decoder.decode(bytearray(data)), data))

    def names(self):
        return [message.get_type() for message, _ in self.take()]

    def close(self):
        self.socket.close()


@pytest.fixture(name="ground")
def _ground():
    ground = Ground()
    yield ground
    ground.close()


@pytest.fixture(name="open_link")
def _open_link():
    links = []

    def open_link(**options):
        links.append(MavlinkLink(MavlinkConfig(**options)))
        return links[-1]

    yield open_link
    for link in links:
        link.close()


def fly(link, seconds, *, first=0):
    """Push rows as a 250 Hz loop does."""
    row, timing = np.zeros(SIGNAL_COUNT), np.zeros(TIMING_COUNT)
    row[COLUMN.nacelle_deg], row[COLUMN.altitude_m], row[COLUMN.pilot_mode] = 90.0, 100.0, 1.0
    used = []
    for number in range(first, first + round(seconds * 250)):
        row[COLUMN.frame], row[COLUMN.time_s] = number, number * 0.004
        sticks = link.input.read()
        used.append(sticks)
        link.report(Feedback(stick=sticks.stick, lever=sticks.lever, input_state=float(sticks.sequence > 0)))
        link.push(row, timing)
        link.watch()
        time.sleep(0.004)
    return used


def sticks(x):
    return dialect.MAVLink_manual_control_message(1, x, 0, 500, 0, 0)


def test_life_of_the_process(open_link, ground):
    link = open_link(targets=(ground.endpoint,))
    assert link.wait_ready()
    names = ground.names()
    assert names
    assert set(names) == {"HEARTBEAT"}
    fly(link, 0.5)
    assert ground.names().count("ATTITUDE") > 15
    ground.send(sticks(300), link.port)
    assert fly(link, 0.1, first=200)[-1].stick == 0.3
    assert link.input.ages().count == 1
    assert link.counters()["peers"] == 1
    begin = time.monotonic()
    link.say("The end is near", severity=4)
    link.close()
    assert time.monotonic() - begin < 2.0
    messages = [message for message, _ in ground.take()]
    assert "The end is near" in [message.text for message in messages if message.get_type() == "STATUSTEXT"]
    assert messages[-1].system_status == dialect.MAV_STATE_POWEROFF
    assert link.port == 0


def test_reading_is_cheap(open_link):
    link = open_link()
    link.wait_ready()
    spent = []
    for _ in range(2000):
        begin = time.perf_counter_ns()
        link.input.read()
        link.input.requests()
        spent.append(time.perf_counter_ns() - begin)
    assert np.median(spent) < 5_000


def test_a_killed_process_is_replaced_and_sticks_go_on(open_link, ground):
    link = open_link(targets=(ground.endpoint,))
    link.wait_ready()
    notes = []
    fly(link, 0.2)
    for message in (
        dialect.MAVLink_param_set_message(1, 1, b"XV_STK_EXPO", 0.25, dialect.MAV_PARAM_TYPE_REAL32),
        dialect.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
        dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
    ):
        ground.send(message, link.port)
    fly(link, 0.3, first=50)
    ground.take()
    link.on_note, port = notes.append, link.port
    os.kill(link._process.pid, signal.SIGKILL)
    number = 150
    end = time.monotonic() + 10.0
    while link.restarts == 0 or not link.ready:
        fly(link, 0.1, first=number)
        number += 25
        assert time.monotonic() < end
    assert link.port == port
    assert notes[-1:] == [f"The MAVLink process ended unexpectedly (ended by SIGKILL); another goes on at port {port}"]
    ground.send(sticks(-400), link.port)
    assert fly(link, 0.2, first=number)[-1].stick == -0.4
    taken = [message for message, _ in ground.take()]
    texts = [message.text for message in taken if message.get_type() == "STATUSTEXT"]
    assert "MAVLink process ended; another goes on" in texts
    assert not [text for text in texts if "Sticks:" in text], "they belong to whom they belonged"
    assert "ATTITUDE" in [message.get_type() for message in taken]
    assert [message.base_mode & 128 for message in taken if message.get_type() == "HEARTBEAT"][-1], "still armed"
    ground.send(dialect.MAVLink_param_request_read_message(1, 1, b"XV_STK_EXPO", -1), link.port)
    fly(link, 0.3, first=number + 50)
    values = [message.param_value for message, _ in ground.take() if message.get_type() == "PARAM_VALUE"]
    assert values == [pytest.approx(0.25)]
    assert link.failure is None


def test_a_process_that_keeps_dying_is_given_up_and_said(open_link):
    link = open_link()
    link.wait_ready()
    end = time.monotonic() + 20.0
    while link.failure is None:
        if link._process.poll() is None:
            link._process.kill()
        fly(link, 0.1)
        assert time.monotonic() < end
    assert link.restarts == 3
    assert "MAVLink" in str(link.failure)


def test_a_taken_port_is_told_in_one_sentence(open_link, ground, capfd):
    link = open_link(bind_port=ground.endpoint.port)
    with pytest.raises(OutputError, match=r"--mavlink-bind.*Address already in use.*choose another port"):
        link.wait_ready(10.0)
    assert capfd.readouterr().err == ""  # the process that could not bind ends without a traceback


def test_the_vehicle_ends_when_the_flight_is_gone(ground):
    """Nobody is left to close it: the flight was killed."""
    import subprocess
    import sys

    from rtsim.processes import safe_environment

    code = (
        "import sys, time\n"
        "from telemetry.exchange.endpoint import Endpoint\n"
        "from telemetry.mavlink.config import MavlinkConfig\n"
        "from telemetry.mavlink.link import MavlinkLink\n"
        f"link = MavlinkLink(MavlinkConfig(targets=(Endpoint('127.0.0.1', {ground.endpoint.port}),)))\n"
        "link.wait_ready(); print(link._process.pid, flush=True); time.sleep(60)\n"
    )
    flight = subprocess.Popen([sys.executable, "-c", code], env=safe_environment(), stdout=subprocess.PIPE, text=True)
    vehicle = int(flight.stdout.readline())
    flight.kill()
    flight.wait()
    flight.stdout.close()
    end = time.monotonic() + 5.0
    while os.path.exists(f"/proc/{vehicle}"):  # noqa: PTH110
        assert time.monotonic() < end
        time.sleep(0.02)


def test_with_a_key_only_signed_frames_act(open_link, tmp_path):
    key = os.urandom(32)
    file = tmp_path / "key"
    file.write_text(key.hex())
    with pytest.raises(InputError, match="chmod 600"):
        MavlinkLink(MavlinkConfig(signing_key_file=str(file)))
    file.chmod(0o600)
    signed, unsigned, wrong = Ground(key), Ground(), Ground(os.urandom(32))
    link = open_link(targets=(signed.endpoint,), signing_key_file=str(file))
    link.wait_ready()
    for stranger in (unsigned, wrong):
        stranger.send(sticks(900), link.port)
    assert fly(link, 0.2)[-1].sequence == 0
    signed.send(sticks(200), link.port)
    assert fly(link, 0.2, first=50)[-1].stick == 0.2
    assert unsigned.take() == wrong.take() == []
    recorded = dialect.MAVLink_manual_control_message(1, 700, 0, 500, 0, 0).pack(signed.encoder)
    signed.socket.sendto(recorded, ("127.0.0.1", link.port))
    assert fly(link, 0.2, first=100)[-1].stick == 0.7
    os.kill(link._process.pid, signal.SIGKILL)
    end, number = time.monotonic() + 10.0, 150
    while link.restarts == 0 or not link.ready:
        number += len(fly(link, 0.1, first=number))
        assert time.monotonic() < end
    before = link.input.read().received_ns
    signed.socket.sendto(recorded, ("127.0.0.1", link.port))  # played again to the new process
    assert fly(link, 0.3, first=number)[-1].received_ns == before
    raw = [data for _, data in signed.take()]
    assert raw
    assert all(data[2] & 1 for data in raw)
    for ground in (signed, unsigned, wrong):
        ground.close()
