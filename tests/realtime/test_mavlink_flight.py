"""Real clients fly the real aircraft: sticks and their loss, MAVSDK, MAVProxy, and what a flood may not do."""

from __future__ import annotations

import contextlib
import math
import os
import queue
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from rtsim.frame import COLUMN
from scenarios.flight.replay import replay_log
from telemetry.log.reader import read_log
from tests.ground_station import free_port

pytestmark = pytest.mark.realtime


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


def test_mavsdk_sees_heading_and_track_go_with_its_stick(start, mavsdk_client):
    """Stick to the left in forward flight: bank, heading, track and position turn to the left together."""
    from mavsdk.plugins.manual_control import ManualControl
    from mavsdk.plugins.telemetry import Telemetry

    port = free_port()
    flight = start(port, "--start", "conversion", "--altitude-m", "300", "--heading-deg", "20", "--duration", "120")
    mavsdk_client.add_any_connection(f"udpin://127.0.0.1:{port}")
    system = mavsdk_client.first_autopilot(150.0)
    telemetry, controls = Telemetry(system), ManualControl(system)
    end = time.monotonic() + 60.0
    while not (telemetry.health_all_ok() and telemetry.position_velocity_ned().velocity.north_m_s > 30.0):
        assert time.monotonic() < end, "no telemetry"
        time.sleep(0.02)
    assert telemetry.heading().heading_deg == pytest.approx(20.0, abs=0.5)
    lever = telemetry.fixedwing_metrics().throttle_percentage
    begin, seen, sticks = time.monotonic(), [], []
    while (seconds := time.monotonic() - begin) < 14.0:
        angle, rate = telemetry.attitude_euler(), telemetry.attitude_angular_velocity_body()
        bank = -12.0 if 1.0 < seconds < 9.0 else 0.0
        stick = 1.9 * math.radians(bank - angle.roll_deg) - 1.2 * rate.roll_rad_s
        controls.set_manual_control_input(0.0, stick, lever, -1.5 * rate.yaw_rad_s)
        moved = telemetry.position_velocity_ned()
        track = math.degrees(math.atan2(moved.velocity.east_m_s, moved.velocity.north_m_s))
        place = moved.position.north_m, moved.position.east_m
        seen.append((seconds, angle.roll_deg, angle.yaw_deg, telemetry.heading().heading_deg, track, *place))
        sticks.append(stick)
        time.sleep(0.02)
    assert replay_log(end_of(flight)).same
    when, bank, yaw, heading, track, north, east = np.array(seen).T
    assert min(sticks) < -0.1
    assert bank.min() < -8.0
    assert np.abs(turned_deg(heading - yaw)).max() < 2.0  # heading comes ten times a second
    assert np.abs(turned_deg(track - yaw)).max() < 5.0
    assert -30.0 < turned_deg(yaw[-1] - yaw[0]) < -8.0
    late = when > when[-1] - 2.0
    flown = math.degrees(math.atan2(east[-1] - east[late][0], north[-1] - north[late][0]))
    assert abs(turned_deg(flown - track[late].mean())) < 2.0


def turned_deg(angle):
    """An angle between -180 and 180 deg."""
    return (angle + 180.0) % 360.0 - 180.0


def end_of(flight):
    """End a flight without a fault, and give its log."""
    assert flight.end()["mavlink"]["faults"] == 0
    return flight.log


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

    def expect(self, pattern, timeout_s=15.0, *, ask=""):
        """Wait for a text; what came before it is forgotten. A question is asked again every second."""
        end = time.monotonic() + timeout_s
        while True:
            found = re.search(pattern, self.text)
            if found:
                self.text = self.text[found.end() :]
                return found
            if time.monotonic() > end:
                pytest.fail(f"MAVProxy did not say {pattern!r} but: {self.text[-2000:]}")
            if ask:
                self.type(ask)
            with contextlib.suppress(queue.Empty):
                self.text += self._pieces.get(timeout=1.0)

    def type(self, line):
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def shown(self, message, *fields):
        """Numbers of the newest message of a kind; MAVProxy says nothing of one that it has not received yet."""
        self.text = ""  # an answer to an earlier question is not the newest
        with contextlib.suppress(queue.Empty):
            while True:
                self._pieces.get_nowait()
        return [
            float(number)
            for number in self.expect(
                rf"{message} {{.*?" + ".*?".join(rf"\b{field} : (-?[\d.e-]+)" for field in fields),
                ask=f"status {message}",
            ).groups()
        ]

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


def test_mavproxy_sees_heading_and_track_go_with_its_sticks(start, tmp_path):
    """Channel 1 to the right in forward flight: bank, heading, track and position turn to the right together."""
    port = free_port()
    flight = start(port, "--start", "conversion", "--altitude-m", "300", "--duration", "120")
    console = Console(port, tmp_path)
    try:
        console.expect("Detected vehicle 1:1", 150.0)
        console.expect(r"Received (\d+) parameters", 30.0)

        def look():
            roll, yaw = console.shown("ATTITUDE", "roll", "yaw")
            latitude, longitude, north, east, heading = console.shown(
                "GLOBAL_POSITION_INT", "lat", "lon", "vx", "vy", "hdg"
            )
            (course,) = console.shown("GPS_RAW_INT", "cog")
            directions = math.degrees(yaw), heading / 100.0, math.degrees(math.atan2(east, north)), course / 100.0
            return math.degrees(roll), np.array(directions), latitude, longitude

        roll, before, *_ = look()
        assert roll == pytest.approx(0.0, abs=0.1)
        np.testing.assert_allclose(turned_deg(before), 0.0, atol=0.2)
        (throttle,) = console.shown("VFR_HUD", "throttle")
        console.type(f"rc 3 {1000 + 10 * throttle + 20:.0f}")
        console.expect("your sticks fly")
        console.type(f"rc 3 {1000 + 10 * throttle:.0f}")
        console.type("rc 1 1560")
        time.sleep(1.2)
        assert console.shown("RC_CHANNELS", "chan1_raw") == [1560.0]
        console.type("rc 1 1500")
        time.sleep(4.0)
        roll, after, latitude, longitude = look()
        time.sleep(1.0)
        _, later, further_north, further_east = look()
        assert 3.0 < roll < 30.0
        assert np.all(turned_deg(after - before) > 2.0)
        assert np.all(turned_deg(later - after) > 0.5)
        assert np.abs(turned_deg(after - after[0])).max() < 6.0  # sideslip, and up to half a second between messages
        east = (further_east - longitude) * math.cos(math.radians(latitude / 1e7))
        flown = math.degrees(math.atan2(east, further_north - latitude))
        assert abs(turned_deg(flown - 0.5 * (after[3] + later[3]))) < 4.0
    finally:
        console.close()
    assert replay_log(end_of(flight)).same
