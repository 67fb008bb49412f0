"""Real clients fly the real aircraft: a scripted hand, MAVSDK, MAVProxy, and what a flood may not do."""

from __future__ import annotations

import json
import math
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import COLUMN
from rtsim.processes import safe_environment
from scenarios.flight.replay import replay_log
from telemetry.log.reader import read_log

pytestmark = pytest.mark.realtime

KNOT = 1852.0 / 3600.0
FORWARD, AFT = 1 << 5, 1 << 4


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


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


@pytest.fixture(name="start")
def _start(tmp_path):
    flights = []

    def start(port, *options):
        flights.append(Flight(port, tmp_path, *options))
        return flights[-1]

    yield start
    for flight in flights:
        if flight.process.poll() is None:
            flight.process.kill()
            flight.process.communicate()


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

    def sticks(self, x=0, z=500, buttons=0):
        self.send(dialect.MAVLink_manual_control_message(1, x, 0, z, 0, buttons))

    def hold(self, seconds, **sticks):
        """Send sticks 50 times a second."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.poll()
            self.sticks(**sticks)
            time.sleep(0.02)

    def close(self):
        self.socket.close()


@pytest.fixture(name="station")
def _station():
    station = Station()
    yield station
    station.close()


class ScriptedHand:
    """Stick, lever and nacelle buttons from what telemetry shows: hover, conversion, cruise, back, and down."""

    def __init__(self, lever, height_m):
        self.lever0, self.height = lever, height_m
        self.reference, self.phase, self.held = 0.0, "out", 0.0
        self.lever_sum = self.pitch_sum = 0.0

    def step(self, *, speed_kt, height_m, climb_m_s, pitch_deg, nacelle_deg, dt):
        goal, rate = (155.0, 2.5) if self.phase == "out" else (0.0, 2.0)
        ahead = float(np.clip(self.reference, speed_kt - 8.0, speed_kt + 8.0))
        self.reference = ahead + float(np.clip(goal - ahead, -rate * dt, rate * dt))
        speed_error = self.reference - speed_kt
        if self.phase == "land":
            self.height = max(self.height - 1.2 * dt, height_m - 3.0)
        climb = float(np.clip(0.25 * (self.height - height_m), -1.2, 2.0)) - climb_m_s
        share = float(np.clip((nacelle_deg - 30.0) / 40.0, 0.0, 1.0))  # 1: the lever holds the height, 0: the pitch
        self.lever_sum += dt * (0.04 * share * climb + 0.004 * (1.0 - share) * speed_error)
        lever = self.lever0 + self.lever_sum + 0.06 * share * climb + 0.012 * (1.0 - share) * speed_error
        self.pitch_sum += dt * (-0.10 * share * speed_error + (1.0 - share) * 0.8 * climb)
        self.pitch_sum = float(np.clip(self.pitch_sum, -8.0, 8.0))
        wanted = np.clip(1.0 + self.pitch_sum - 0.7 * share * speed_error + 1.6 * (1.0 - share) * climb, -9.0, 10.0)
        stick = float(np.clip(-0.12 * (wanted - pitch_deg), -0.6, 0.6))
        steady = abs(climb_m_s) < 0.7 and (
            (self.phase == "out" and nacelle_deg < 0.5 and abs(speed_kt - 155.0) < 3.0)
            or (self.phase == "back" and nacelle_deg > 89.5 and abs(speed_kt) < 5.0)
        )
        self.held = self.held + dt if steady else 0.0
        if self.held > 3.0:
            self.phase, self.held = ("back" if self.phase == "out" else "land"), 0.0
        return stick, float(np.clip(lever, 0.0, 1.0)), self._nacelle(nacelle_deg)

    def _nacelle(self, nacelle_deg):
        if self.phase == "out":
            wanted = np.interp(self.reference, [0.0, 60.0, 100.0, 125.0, 140.0], [82.0, 75.0, 60.0, 30.0, 0.0])
            return FORWARD if nacelle_deg > wanted + 0.3 else 0
        wanted = np.interp(self.reference, [30.0, 65.0, 100.0, 120.0, 135.0], [90.0, 75.0, 60.0, 30.0, 0.0])
        return AFT if nacelle_deg < wanted - 0.3 else 0


@pytest.mark.slow
def test_a_hand_flies_out_and_back_and_lands_and_the_log_replays(start, station):
    flight = start(station.port, "--speed", "3", "--altitude-m", "40", "--duration", "400")
    station.wait_for_flight(flight)
    hand = ScriptedHand((station.last["RC_CHANNELS"].chan3_raw - 1000) / 1000.0, 40.0)
    phases, before = [], station.last["ATTITUDE"].time_boot_ms
    end = time.monotonic() + 150.0
    while flight.process.poll() is None and time.monotonic() < end:
        station.poll()
        now = station.last["ATTITUDE"].time_boot_ms
        if now > before:
            position, hud = station.last["LOCAL_POSITION_NED"], station.last["VFR_HUD"]
            along = position.vx * math.cos(math.radians(hud.heading)) + position.vy * math.sin(
                math.radians(hud.heading)
            )
            stick, lever, buttons = hand.step(
                speed_kt=along / KNOT,
                height_m=-position.z,
                climb_m_s=-position.vz,
                pitch_deg=math.degrees(station.last["ATTITUDE"].pitch),
                nacelle_deg=station.values["nac_deg"],
                dt=(now - before) / 1000.0,
            )
            station.sticks(round(1000 * stick), round(1000 * lever), buttons)
            before = now
            if hand.phase not in phases:
                phases.append(hand.phase)
        station.heard.clear()
        time.sleep(0.003)
    summary = flight.end()
    assert phases == ["out", "back", "land"]
    assert "touched down gently" in summary["end_reason"]
    assert summary["completed"]
    assert flight.process.returncode == 0
    assert summary["corridor"]["exceedances"] == 0
    assert summary["corridor"]["worst_margin_kt"] > 5.0
    log = read_log(flight.log)
    assert np.min(log.history[:, COLUMN.nacelle_deg]) < 0.5
    assert np.max(log.history[:, COLUMN.airspeed_kt]) > 150.0
    result = replay_log(flight.log)
    assert result.same, result.difference
    assert result.stated_sha256 == summary["history_sha256"]


def test_sticks_reach_the_aircraft_at_once_and_their_loss_is_handled(start, station):
    flight = start(station.port, "--duration", "60")
    station.wait_for_flight(flight)
    lever = station.last["RC_CHANNELS"].chan3_raw - 1000
    station.hold(1.0, z=lever)
    begin = time.monotonic()
    station.hold(4.0, z=lever)
    # Rates and clock.
    for name, rate in (("ATTITUDE", 50), ("LOCAL_POSITION_NED", 20), ("VFR_HUD", 10), ("HEARTBEAT", 1)):
        count = len([1 for at, _ in station.since(name, begin) if at < begin + 4.0])
        assert count == pytest.approx(4 * rate, rel=0.05, abs=1.5), name
    stamps = [message.time_boot_ms for _, message in station.since("ATTITUDE", begin)]
    assert np.max(np.diff(stamps)) <= 60
    assert stamps[-1] - stamps[0] == pytest.approx(4000, abs=80)
    # A deflection turns the aircraft within a few frames; the pitch rate shows it.
    moment = time.monotonic()
    station.hold(0.4, x=500, z=lever)
    rates = [(at - moment, message.pitchspeed) for at, message in station.since("ATTITUDE", moment)]
    first = next(at for at, rate in rates if rate < -0.003)
    assert first < 0.2
    # Silence: warned, centred, lever held; and back again without a jump.
    silent = time.monotonic()
    station.wait_for(lambda: any("lost" in m.text for _, m in station.since("STATUSTEXT", silent)), 2.0)
    warned = next(at for at, m in station.since("STATUSTEXT", silent) if "lost" in m.text)
    assert 0.4 < warned - silent < 0.9
    station.wait_for(lambda: time.monotonic() > silent + 1.2)
    assert station.last["RC_CHANNELS"].chan2_raw == 1500
    assert station.last["RC_CHANNELS"].chan3_raw == pytest.approx(1000 + lever, abs=1)
    back = time.monotonic()
    station.hold(0.2, z=lever)  # through the centre: nothing moves before
    station.hold(0.6, x=-200, z=lever)
    assert station.last["RC_CHANNELS"].chan2_raw == 1600
    assert any("regained" in m.text for _, m in station.since("STATUSTEXT", back))
    summary = flight.end()
    assert flight.process.returncode == 130
    age = summary["mavlink"]["input_age_ms"]
    assert age["p50"] <= 5.0 + 4.0  # its tail is the machine's of the moment: docs/performance.md
    history = read_log(flight.log).history
    assert np.max(np.abs(np.diff(history[:, COLUMN.pilot_stick]))) <= 0.51  # the hand's own move, no other
    assert replay_log(flight.log).same


FLOOD = """
import os, socket, sys, time
from pymavlink.dialects.v20 import all as dialect
kind, port, seconds, rate = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
encoder = dialect.MAVLink(None, srcSystem=254, srcComponent=9)
packets = {
    "garbage": [os.urandom(60) for _ in range(64)],
    "heartbeats": [dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(encoder)],
    "sticks": [dialect.MAVLink_manual_control_message(1, 900, 0, 0, 0, 0).pack(encoder)],
    "lists": [dialect.MAVLink_param_request_list_message(1, 1).pack(encoder)],
}[kind]
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sent, start = 0, time.monotonic()
while (elapsed := time.monotonic() - start) < seconds:
    while sent < elapsed * rate:
        sock.sendto(packets[sent % len(packets)], ("127.0.0.1", port))
        sent += 1
    time.sleep(0.0005)
print(sent)
"""


@pytest.mark.parametrize("kind", ["garbage", "heartbeats", "sticks", "lists"])
def test_a_flood_of_20000_packets_a_second_matters_to_nobody(start, station, kind):
    flight = start(station.port, "--duration", "60")
    station.wait_for_flight(flight)
    lever = station.last["RC_CHANNELS"].chan3_raw - 1000
    station.hold(1.0, z=lever)
    flood = subprocess.Popen(
        [sys.executable, "-c", FLOOD, kind, str(station.vehicle[1]), "3", "20000"], stdout=subprocess.PIPE, text=True
    )
    begin = time.monotonic()
    for number in range(150):
        station.poll()
        station.sticks(x=100 + number % 50, z=lever)
        time.sleep(0.02)
    last = station.last["RC_CHANNELS"].chan2_raw
    sent = int(flood.communicate(timeout=10)[0])
    assert sent > 40_000
    assert 1425 <= last <= 1450  # the owner's stick, never the flood's 0.9
    attitudes = [at for at, _ in station.since("ATTITUDE", begin)]
    assert len(attitudes) > 0.9 * 50 * (attitudes[-1] - begin)
    summary = flight.end()
    counts = summary["mavlink"]
    assert counts["faults"] == counts["restarts"] == 0
    assert counts["inputs"] > 0.95 * (150 + 45)
    assert counts["sent"] < 20_000
    assert summary["drift_frames"] <= 1.0
    assert summary["frames"] == pytest.approx(summary["wall_s"] * 250, abs=2)
    assert counts["input_age_ms"]["p50"] <= 5.0 + 4.0


@pytest.fixture(name="mavsdk_client")
def _mavsdk_client():
    from mavsdk import ComponentType, Configuration, Mavsdk

    client = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    yield client
    client.destroy()


def test_mavsdk_flies_it(start, mavsdk_client):
    from mavsdk import MavsdkError
    from mavsdk.plugins.action import Action
    from mavsdk.plugins.info import Info
    from mavsdk.plugins.manual_control import ManualControl
    from mavsdk.plugins.param import Param
    from mavsdk.plugins.telemetry import Telemetry

    port = free_port()
    flight = start(port, "--duration", "120")
    mavsdk_client.add_any_connection(f"udpin://127.0.0.1:{port}")
    system = mavsdk_client.first_autopilot(150.0)
    assert system is not None
    telemetry, action, parameters = Telemetry(system), Action(system), Param(system)
    controls, information = ManualControl(system), Info(system)

    def wait_for(condition, timeout_s=10.0):
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, "nothing came of it"
            time.sleep(0.02)

    wait_for(lambda: telemetry.health_all_ok() and telemetry.health().is_armable, 60.0)
    assert telemetry.in_air()
    assert information.get_version().flight_sw_minor >= 0
    assert telemetry.position().relative_altitude_m == pytest.approx(100.0, abs=1.0)
    listed = parameters.get_all_params()
    assert listed.int_params == []
    assert "XV_NAC_RATE" in {parameter.name for parameter in listed.float_params}
    parameters.set_param_float("XV_NAC_RATE", 5.0)
    assert parameters.get_param_float("XV_NAC_RATE") == 5.0
    with pytest.raises(MavsdkError):
        parameters.set_param_float("XV_NAC_RATE", 500.0)
    action.arm()
    wait_for(telemetry.armed)
    lever = telemetry.fixedwing_metrics().throttle_percentage
    stop = threading.Event()

    def move():
        while not stop.is_set():
            controls.set_manual_control_input(0.0, 0.0, lever, 0.0)
            time.sleep(0.02)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        wait_for(lambda: int(telemetry.flight_mode()) != 3)  # the virtual pilot's Hold ends when sticks come
        wait_for(lambda: telemetry.rc_status().is_available)
        action.transition_to_fixedwing()
        wait_for(lambda: int(telemetry.vtol_state()) == 1)
        action.set_actuator(1, 0.9)
        action.transition_to_multicopter()
        wait_for(lambda: int(telemetry.vtol_state()) == 3, 20.0)
        controls.start_altitude_control()
        wait_for(lambda: int(telemetry.flight_mode()) == 10)
        action.hold()
        wait_for(lambda: int(telemetry.flight_mode()) == 3)
        with pytest.raises(MavsdkError):
            action.takeoff()
        action.disarm()
        wait_for(lambda: not telemetry.armed())
    finally:
        stop.set()
        mover.join()
    summary = flight.end()
    assert summary["mavlink"]["input_age_ms"]["p50"] <= 5.0 + 4.0
    assert replay_log(flight.log).same


class Console:
    """MAVProxy behind pipes."""

    def __init__(self, port, folder):
        script = Path(sys.executable).parent / "mavproxy.py"
        environment = {**os.environ, "HOME": str(folder)}
        self.process = subprocess.Popen(
            [sys.executable, str(script), f"--master=udp:127.0.0.1:{port}", f"--state-basedir={folder}"],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.text = ""
        self._pieces = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while piece := self.process.stdout.read1(4096):
            self._pieces.put(piece.decode(errors="replace"))

    def expect(self, pattern, timeout_s=15.0):
        """Wait for a text; what came before it is forgotten."""
        end = time.monotonic() + timeout_s
        while True:
            found = re.search(pattern, self.text)
            if found:
                self.text = self.text[found.end() :]
                return found
            try:
                self.text += self._pieces.get(timeout=max(0.01, end - time.monotonic()))
            except queue.Empty:
                pytest.fail(f"MAVProxy did not say {pattern!r} but: {self.text[-2000:]}")

    def type(self, line):
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


def test_mavproxy_flies_it(start, tmp_path):
    port = free_port()
    flight = start(port, "--duration", "120")
    console = Console(port, tmp_path)
    try:
        console.expect("Detected vehicle 1:1", 150.0)
        console.expect(r"Received (\d+) parameters", 30.0)
        console.type("param set XV_NAC_RATE 4")
        time.sleep(1.0)
        console.type("param show XV_NAC_RATE")
        console.expect(r"XV_NAC_RATE\s+4\.0")
        console.type("arm throttle")
        console.expect("COMPONENT_ARM_DISARM: ACCEPTED")
        console.expect("ARMED")
        console.type("rc 3 1760")
        console.expect("your sticks fly")
        time.sleep(0.3)
        console.type("rc 3 1700")
        console.type("rc 2 1450")
        time.sleep(1.0)
        console.type("status RC_CHANNELS")
        console.expect(r"chan2_raw : 1450, chan3_raw : 1700")
        console.type("long DO_VTOL_TRANSITION 4")
        console.expect("DO_VTOL_TRANSITION: ACCEPTED")
        time.sleep(1.0)
        console.type("status EXTENDED_SYS_STATE")
        console.expect("vtol_state : 1")
        console.type("long DO_SET_MODE 1 2 0")
        console.expect("DO_SET_MODE: ACCEPTED")
        console.expect("ALTCTL")
        console.type("rc all 0")
        console.expect("Sticks lost")
        console.type("disarm")
        console.expect("DISARMED")
    finally:
        console.close()
    assert flight.end()["mavlink"]["faults"] == 0
    assert replay_log(flight.log).same
