"""The vehicle without a socket: identity, units and signs, commands, parameters, sticks, owners, peers."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.exchange.globe import HomePosition
from telemetry.exchange.ring import ROW_WIDTH
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import ALIVE, Exchange, Feedback, Request
from telemetry.mavlink.peers import MOST_PEERS
from telemetry.mavlink.vehicle import Vehicle

HEARTBEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
GROUND = ("127.0.0.1", 14550)
OTHER = ("127.0.0.1", 14999)
AIDS = {"rate_damping": True, "attitude_retention": True, "altitude_hold": False, "airspeed_hold": False}
FLIGHT = {
    "airspeed_kt": 80.0,
    "ground_speed_kt": 85.0,
    "nacelle_deg": 75.0,
    "nacelle_reference_deg": 74.0,
    "altitude_m": 123.0,
    "pitch_deg": 4.0,
    "pitch_rate_deg_s": -2.0,
    "climb_rate_m_s": 1.5,
    "heading_deg": 350.0,
    "track_deg": 350.0,
    "north_m": 984.8,
    "east_m": -173.6,
    "lever": 0.55,
    "stick": 0.12,
    "margin_low_kt": 70.0,
    "margin_high_kt": 60.0,
    "flapping_deg": 3.0,
    "rotor_speed_rpm": 589.0,
    "mast_torque_inlb": 65_000.0,
    "pilot_mode": 1.0,
}


class Bench:
    """A vehicle, its shared memory, a clock, and ground stations."""

    def __init__(self, **options):
        self.exchange = Exchange()
        self.sent = []
        self.now = 1000.0
        self.frame = 0
        self.time_s = 0.0
        self.config = MavlinkConfig(aids=AIDS, version="1.2.3", **options)
        self.vehicle = Vehicle(
            self.config, self.exchange, send=lambda data, to: self.sent.append((data, to)), now=1000.0
        )
        self._encoders = {}
        self._decoder = dialect.MAVLink(None)
        self.signals = dict(FLIGHT)
        self.feedback = Feedback(
            stick=0.2, lever=0.5, nacelle_command=math.radians(74.0), input_state=1.0, age=0.003, aids=3.0
        )

    def send(self, message, *, system=255, component=190, address=GROUND):
        key = system, component, address
        encoder = self._encoders.setdefault(key, dialect.MAVLink(None, srcSystem=system, srcComponent=component))
        data = message.pack(encoder)
        encoder.seq = (encoder.seq + 1) % 256
        self.receive(data, address)

    def receive(self, data, address=GROUND):
        self.vehicle.receive(bytes(data), address, received_ns=int(self.now * 1e9), now=self.now)

    def join(self, address, *, answer=True):
        """Send a heartbeat and answer the PING that comes back, as ground stations do; gives what came before it."""
        self.send(HEARTBEAT, address=address)
        came = self.taken(address=address)
        ping = next(message for message in came if message.get_type() == "PING")
        if answer:
            self.send(dialect.MAVLink_ping_message(ping.time_usec, ping.seq, 1, 1), address=address)
        return came

    def fly(self, seconds):
        """Frames of 20 ms, each with a row and a tick."""
        for _ in range(max(1, round(seconds / 0.02))):
            row = np.zeros((1, ROW_WIDTH))
            for name, value in self.signals.items():
                row[0, getattr(COLUMN, name)] = value
            row[0, COLUMN.frame], row[0, COLUMN.time_s] = self.frame, self.time_s
            row[0, SIGNAL_COUNT + 1] = 400.0
            self.exchange.write_feedback(self.feedback)
            self.vehicle.observe(row, self.now)
            self.vehicle.tick(self.now)
            self.now += 0.02
            self.time_s += 0.02
            self.frame += 5

    def taken(self, name=None, address=GROUND):
        """Messages sent to an address since the last look."""
        messages = [self._decoder.decode(bytearray(data)) for data, to in self.sent if to == address]
        self.sent = [entry for entry in self.sent if entry[1] != address]
        return messages if name is None else [message for message in messages if message.get_type() == name]

    def command(self, number, *values, address=GROUND, system=255):
        """Send a command and give its result."""
        self.taken(address=address)
        padded = [*values, *([0.0] * (7 - len(values)))]
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *padded), address=address, system=system)
        self.answer = self.taken(address=address)
        acks = [message for message in self.answer if message.get_type() == "COMMAND_ACK"]
        assert len(acks) == 1, self.answer
        assert acks[0].command == number
        assert (acks[0].target_system, acks[0].target_component) == (system, 190)
        return acks[0].result

    def requests(self):
        return self.exchange.take_requests()

    def texts(self):
        return [message.text for message in self.taken("STATUSTEXT")]

    def close(self):
        self.exchange.close()


@pytest.fixture(name="bench")
def _bench():
    bench = Bench()
    bench.fly(0.1)
    bench.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    bench.taken()
    yield bench
    bench.close()


def manual(x=0, z=500, **fields):
    values = {"y": 0, "r": 0, "buttons": 0, **fields}
    return dialect.MAVLink_manual_control_message(
        1, x, values.pop("y"), z, values.pop("r"), values.pop("buttons"), **values
    )


def newest(bench, name):
    bench.taken()
    bench.fly(2.1)
    return bench.taken(name)[-1]


def test_heartbeat_is_first_and_says_tiltrotor():
    bench = Bench()
    bench.vehicle.tick(bench.now)
    messages = bench.taken()
    assert {message.get_type() for message in messages} == {"HEARTBEAT"}
    beat = messages[0]
    assert (beat.type, beat.autopilot, beat.system_status) == (21, 12, dialect.MAV_STATE_BOOT)
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
    bench.fly(0.1)
    beat = bench.taken("HEARTBEAT")[-1]
    assert beat.system_status == dialect.MAV_STATE_STANDBY
    assert beat.base_mode & 1
    assert beat.custom_mode == 0x00070000  # Stabilized: attitude retention is on
    bench.close()


def test_default_rates(bench):
    bench.fly(10.0)
    counts = {}
    for message in bench.taken():
        counts[message.get_type()] = counts.get(message.get_type(), 0) + 1
    expected = {
        "HEARTBEAT": 10, "SYS_STATUS": 20, "EXTENDED_SYS_STATE": 20, "ATTITUDE": 500, "ATTITUDE_QUATERNION": 500,
        "LOCAL_POSITION_NED": 200, "GLOBAL_POSITION_INT": 100, "VFR_HUD": 100, "NAMED_VALUE_FLOAT": 1000,
        "DEBUG_FLOAT_ARRAY": 100, "RC_CHANNELS": 100, "SERVO_OUTPUT_RAW": 20, "ALTITUDE": 20, "GPS_RAW_INT": 20,
        "BATTERY_STATUS": 10, "WIND_COV": 10, "HOME_POSITION": 5, "SYSTEM_TIME": 10, "CURRENT_MODE": 10,
    }  # fmt: skip
    for name, count in expected.items():
        assert counts[name] == pytest.approx(count, rel=0.02, abs=2), name
    assert set(counts) - set(expected) <= {"STATUSTEXT"}


def test_units_and_signs_agree_across_messages(bench):
    bench.fly(2.1)
    by_name = {message.get_type(): message for message in bench.taken()}
    attitude, quaternion = by_name["ATTITUDE"], by_name["ATTITUDE_QUATERNION"]
    assert attitude.pitch == pytest.approx(math.radians(4.0))
    assert attitude.pitchspeed == pytest.approx(math.radians(-2.0))
    assert attitude.roll == attitude.rollspeed == attitude.yawspeed == 0.0  # of a flight straight ahead
    q1, q2, q3, q4 = quaternion.q1, quaternion.q2, quaternion.q3, quaternion.q4
    assert math.asin(2.0 * (q1 * q3 - q4 * q2)) == pytest.approx(attitude.pitch, abs=1e-6)
    yaw = math.atan2(2.0 * (q1 * q4 + q2 * q3), 1.0 - 2.0 * (q3**2 + q4**2))
    assert yaw == pytest.approx(attitude.yaw, abs=1e-6)
    assert math.degrees(attitude.yaw) == pytest.approx(-10.0, abs=1e-4)
    assert attitude.time_boot_ms == quaternion.time_boot_ms
    local, glob, hud = by_name["LOCAL_POSITION_NED"], by_name["GLOBAL_POSITION_INT"], by_name["VFR_HUD"]
    assert (local.z, local.vz) == (-123.0, -1.5)
    assert (local.x, local.y) == pytest.approx((984.8, -173.6))
    assert math.hypot(local.vx, local.vy) == pytest.approx(85.0 * 0.514444, rel=1e-5)
    assert math.atan2(local.vy, local.vx) == pytest.approx(attitude.yaw, abs=1e-5)
    assert (glob.relative_alt, glob.alt, glob.vz) == (123_000, 123_000, -150)
    assert glob.hdg == 35_000
    assert math.hypot(glob.vx, glob.vy) == pytest.approx(100.0 * 85.0 * 0.514444, abs=1.0)
    assert (glob.lat - 374_080_000) * 1e-7 * 111_195 == pytest.approx(local.x, abs=1.0)
    assert hud.airspeed == pytest.approx(80.0 * 0.514444, rel=1e-5)
    assert hud.groundspeed == pytest.approx(85.0 * 0.514444, rel=1e-5)
    assert (hud.climb, hud.alt, hud.heading, hud.throttle) == (1.5, 123.0, 350, 55)
    status = by_name["SYS_STATUS"]
    assert status.load == 100  # 400 us of 4 ms
    assert 20_000 < status.voltage_battery < 30_000
    for bit in (0x1, 0x2, 0x4, 0x8, 0x20, 0x10000, 0x10000000):
        assert status.onboard_control_sensors_present & bit
        assert status.onboard_control_sensors_health & bit
    gps = by_name["GPS_RAW_INT"]
    assert (gps.fix_type, gps.lat, gps.lon) == (3, glob.lat, glob.lon)
    channels = by_name["RC_CHANNELS"]
    assert (channels.chan1_raw, channels.chan2_raw, channels.chan3_raw, channels.chan4_raw) == (1500, 1400, 1500, 1500)
    assert channels.chan6_raw == round(1000 + 1000 * 74.0 / 90.0)
    assert channels.chancount == 8
    array = by_name["DEBUG_FLOAT_ARRAY"]
    assert array.name == "xv15"
    assert array.data[:5] == pytest.approx([75.0, 74.0, 70.0, 60.0, 3.0])
    assert array.data[6:8] == pytest.approx([100.0, 50.0])
    assert array.data[9:11] == pytest.approx([0.4, 3.0])


TURN = {
    "bank_deg": -30.0, "pitch_deg": 10.0, "heading_deg": 200.0, "roll_rate_deg_s": 4.0, "yaw_rate_deg_s": -8.0,
    "track_deg": 215.0, "ground_speed_kt": 60.0, "north_m": -300.0, "east_m": 150.0, "sideslip_deg": -6.0,
    "lateral_acceleration": 0.05, "wind_north_m_s": -3.0, "wind_east_m_s": 4.0, "flapping_left_deg": 2.0,
    "flapping_right_deg": 4.0, "mast_torque_left_inlb": 130_000.0, "mast_torque_right_inlb": 65_000.0,
    "collective_75_deg": 20.0, "differential_collective_deg": 2.0, "cyclic_deg": -1.0, "differential_cyclic_deg": 0.5,
    "aileron_deg": -10.0, "rudder_deg": 5.0,
}  # fmt: skip


def test_a_turn_is_seen_in_attitude_position_and_wind(bench):
    """Left turn to the south-west, drifting: roll negative, course by the track, place by north and east."""
    bench.signals |= TURN
    bench.fly(2.1)
    by_name = {message.get_type(): message for message in bench.taken()}
    attitude, quaternion = by_name["ATTITUDE"], by_name["ATTITUDE_QUATERNION"]
    angles = [math.degrees(angle) for angle in (attitude.roll, attitude.pitch, attitude.yaw)]
    assert angles == pytest.approx([-30.0, 10.0, -160.0], abs=1e-4)
    rates = [math.degrees(rate) for rate in (attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)]
    assert rates == pytest.approx([4.0, -2.0, -8.0], abs=1e-4)
    w, x, y, z = quaternion.q1, quaternion.q2, quaternion.q3, quaternion.q4
    assert w * w + x * x + y * y + z * z == pytest.approx(1.0, abs=1e-6)
    assert math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)) == pytest.approx(attitude.roll, abs=1e-6)
    assert math.asin(2.0 * (w * y - z * x)) == pytest.approx(attitude.pitch, abs=1e-6)
    assert math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) == pytest.approx(attitude.yaw, abs=1e-6)
    local, glob = by_name["LOCAL_POSITION_NED"], by_name["GLOBAL_POSITION_INT"]
    assert (local.x, local.y) == (-300.0, 150.0)
    assert math.degrees(math.atan2(local.vy, local.vx)) % 360.0 == pytest.approx(215.0, abs=1e-3)
    assert math.hypot(local.vx, local.vy) == pytest.approx(60.0 * 0.514444, rel=1e-5)
    assert (glob.lat - 374_080_000) * 1e-7 * 111_195 == pytest.approx(-300.0, abs=0.1)
    east = (glob.lon + 1_211_090_000) * 1e-7 * 111_195 * math.cos(math.radians(37.408))
    assert east == pytest.approx(150.0, abs=0.1)
    assert (glob.hdg, by_name["VFR_HUD"].heading, by_name["GPS_RAW_INT"].cog) == (20_000, 200, 21_500)
    wind = by_name["WIND_COV"]
    assert (wind.wind_x, wind.wind_y, wind.wind_z, wind.wind_alt) == (-3.0, 4.0, 0.0, 123.0)


def test_left_and_right_are_mean_less_and_plus_half_the_difference(bench):
    bench.signals |= TURN
    bench.fly(2.1)
    taken = bench.taken()
    by_name = {message.get_type(): message for message in taken}
    servo = by_name["SERVO_OUTPUT_RAW"]
    assert (servo.servo3_raw, servo.servo8_raw, servo.servo9_raw) == (1400, 1360, 1440)
    assert (servo.servo2_raw, servo.servo10_raw, servo.servo11_raw) == (1450, 1425, 1475)
    assert (servo.servo6_raw, servo.servo7_raw, servo.servo12_raw) == (1250, 1625, 0)
    values = {message.name: message.value for message in taken if message.get_type() == "NAMED_VALUE_FLOAT"}
    assert (values["slip_deg"], values["ball_g"]) == pytest.approx((-6.0, 0.05))
    assert values["trq_pct"] == pytest.approx(100.0)  # of the left mast
    assert by_name["DEBUG_FLOAT_ARRAY"].data[16:22] == pytest.approx([-6.0, 0.05, 2.0, 4.0, 100.0, 50.0])


def test_a_heading_just_west_of_north_is_not_sent_as_a_whole_turn(bench):
    bench.signals |= {"heading_deg": 359.999}
    bench.fly(0.2)
    assert bench.taken("GLOBAL_POSITION_INT")[-1].hdg == 0
    bench.signals |= {"heading_deg": 359.6}
    bench.fly(0.2)
    assert bench.taken("VFR_HUD")[-1].heading == 0


def test_home_is_where_and_how_the_flight_began():
    bench = Bench(home=HomePosition(latitude_deg=47.0, longitude_deg=8.0, heading_deg=90.0))
    bench.signals |= TURN
    bench.fly(2.1)
    home = bench.taken("HOME_POSITION")[-1]
    assert (home.latitude, home.longitude) == (470_000_000, 80_000_000)
    assert home.q == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])


def test_named_values(bench):
    bench.fly(0.2)
    values = {message.name: message.value for message in bench.taken("NAMED_VALUE_FLOAT")}
    assert values["nac_deg"] == 75.0
    assert values["corr_lo"] == 70.0
    assert values["corr_hi"] == 60.0
    assert values["flap_deg"] == 3.0
    assert values["rpm_pct"] == 100.0
    assert values["trq_pct"] == 50.0
    assert values["in_age_ms"] == pytest.approx(3.0)


def test_time_is_simulated_and_goes_on_over_a_reset(bench):
    bench.fly(1.0)
    before = bench.taken("ATTITUDE")[-1].time_boot_ms
    bench.time_s, bench.frame = 0.0, 0
    bench.fly(0.5)
    stamps = [message.time_boot_ms for message in bench.taken("ATTITUDE")]
    assert stamps[0] == before + 4
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] == pytest.approx(480, abs=21)


@pytest.mark.parametrize(
    ("angle", "rate", "expected"), [(90, 0, 3), (86, -7, 3), (80, -7, 1), (40, 7, 2), (1.5, -1, 4), (0, 0, 4)]
)
def test_vtol_state_follows_the_nacelles(bench, angle, rate, expected):
    bench.signals |= {"nacelle_deg": angle, "nacelle_rate_deg_s": rate}
    bench.taken()
    bench.fly(0.02)
    states = bench.taken("EXTENDED_SYS_STATE")
    assert bench.vehicle.state.vtol_state == expected
    if expected != 1:  # told at once, not at the next half second (1 is what it said before)
        assert states[-1].vtol_state == expected


def test_arming_shows_at_once_and_needs_centred_sticks(bench):
    assert bench.command(400, 1.0) == 0
    assert [m.base_mode & 128 for m in bench.answer if m.get_type() == "HEARTBEAT"] == [128]
    assert bench.command(400, 0.0) == 0
    bench.send(manual(x=600))
    assert bench.command(400, 1.0) == 1
    assert bench.command(400, 1.0, 21196.0) == 0
    assert bench.command(400, 0.0) == 0
    bench.send(manual(x=10))
    assert bench.command(400, 1.0) == 0
    for wrong in (0.5, -1.0, math.nan, math.inf, 3.4e38):
        assert bench.command(400, wrong) == 2


@pytest.mark.parametrize(
    ("main", "sub", "asked"),
    [
        (1, 0, {"attitude_retention": 0, "altitude_hold": 0, "airspeed_hold": 0}),
        (7, 0, {"attitude_retention": 1, "altitude_hold": 0, "airspeed_hold": 0}),
        (2, 0, {"attitude_retention": 1, "altitude_hold": 1, "airspeed_hold": 0}),
        (3, 0, {"attitude_retention": 1, "altitude_hold": 1, "airspeed_hold": 1}),
    ],
)
def test_modes_switch_the_holds_and_give_the_sticks(bench, main, sub, asked):
    assert bench.command(176, 1.0, main, sub) == 0
    requests = bench.requests()
    assert {request.name: request.value for request in requests if request.kind == "aid"} == asked
    assert requests[-1] == Request("pilot", "external")


def test_hold_mode_is_the_virtual_pilot(bench):
    assert bench.command(176, 1.0, 4.0, 3.0) == 0
    assert bench.requests() == [Request("pilot", "mocm")]
    bench.signals["pilot_mode"] = 0.0
    bench.fly(0.02)
    assert bench.taken("HEARTBEAT")[-1].custom_mode == 0x03040000


@pytest.mark.parametrize(
    "values", [(1, 9, 0), (0, 1, 0), (1, math.nan, 0), (1, 1, 3.4e38), (math.inf, 1, 0), (1, -1, 0)]
)
def test_unknown_modes_are_denied(bench, values):
    assert bench.command(176, *values) == 2
    assert bench.requests() == []


def test_set_mode_message_is_acknowledged(bench):
    bench.send(dialect.MAVLink_set_mode_message(1, 1, 0x00010000))
    assert [ack.result for ack in bench.taken("COMMAND_ACK")] == [0]
    assert bench.requests()[-1] == Request("pilot", "external")


def test_available_modes_come_all_after_one_request(bench):
    assert bench.command(512, 435.0) == 0
    modes = [message for message in bench.answer if message.get_type() == "AVAILABLE_MODES"]
    assert [mode.mode_index for mode in modes] == list(range(1, modes[0].number_modes + 1))
    names = [mode.mode_name for mode in modes]
    assert names == ["Manual", "Stabilized", "Altitude", "Position", "Hold"]
    assert all("_" not in name for name in names)
    assert bench.answer[0].get_type() == "COMMAND_ACK"
    assert bench.command(512, 435.0, 2.0) == 0
    assert [m.mode_name for m in bench.answer[1:]] == ["Stabilized"]
    assert bench.command(512, 435.0, 9.0) == 2


def test_only_modes_the_flight_has_are_offered():
    exchange = Exchange()
    vehicle = Vehicle(MavlinkConfig(aids={}), exchange, send=lambda *_: None, now=0.0)
    assert [mode.name for mode in vehicle.modes] == ["Manual", "Hold"]
    assert "XV_SAS" not in vehicle.store.index
    exchange.close()


def test_transition_actuator_and_nacelle_parameter_become_requests(bench):
    assert bench.command(3000, 4.0) == 0
    assert bench.command(3000, 3.0) == 0
    assert bench.command(187, 0.0, math.nan, math.nan, math.nan, math.nan, math.nan, 0.0) == 0
    transition, back, actuator = bench.requests()
    assert transition == Request("transition", "", 4.0)
    assert back == Request("transition", "", 3.0)
    assert actuator.kind == "nacelle"
    assert math.degrees(actuator.value) == pytest.approx(45.0)
    for wrong in (0.0, 5.0, math.nan, 3.5):
        assert bench.command(3000, wrong) == 2
    assert bench.command(187, 1.5) == 2
    assert bench.command(187, math.nan) == 2
    assert bench.command(187, 0.0, 0.5) == 3
    assert bench.requests() == []


def test_the_transition_asked_for_shows_at_once(bench):
    bench.signals["nacelle_deg"] = 90.0
    bench.fly(0.1)
    bench.feedback = bench.feedback._replace(transition=4.0)
    bench.fly(0.02)
    assert bench.taken("EXTENDED_SYS_STATE")[-1].vtol_state == 1


@pytest.mark.parametrize("number", [22, 21, 20, 519, 300, 16, 65535, 246])
def test_what_is_not_there_is_said_to_be_unsupported(bench, number):
    assert bench.command(number, 1.0) == 3


def test_reboot_resets_only_where_it_may():
    bench = Bench(reboot_resets=True)
    bench.fly(0.1)
    assert bench.command(246, 1.0) == 0
    assert bench.requests() == [Request("reset")]
    assert bench.command(246, 2.0) == 2
    bench.close()


def test_message_intervals_are_per_station(bench):
    bench.join(OTHER)
    assert bench.command(511, 30.0, 100_000.0) == 0
    bench.sent.clear()
    bench.fly(2.0)
    assert len(bench.taken("ATTITUDE")) == pytest.approx(20, abs=1)
    assert len(bench.taken("ATTITUDE", OTHER)) == pytest.approx(100, abs=1)
    assert bench.command(510, 30.0) == 0
    assert bench.answer[-1].interval_us == 100_000
    assert bench.command(511, 30.0, -1.0) == 0
    bench.taken()
    bench.fly(1.0)
    assert bench.taken("ATTITUDE") == []
    assert bench.command(510, 30.0) == 0
    assert bench.answer[-1].interval_us == -1
    assert bench.command(511, 30.0, 0.0) == 0
    assert bench.command(510, 30.0) == 0
    assert bench.answer[-1].interval_us == 20_000
    assert bench.command(511, 30.0, 1.0) == 0  # faster than the frame rate
    assert bench.command(510, 30.0) == 0
    assert bench.answer[-1].interval_us == 4000


@pytest.mark.parametrize(
    ("values", "result"),
    [
        ((0, -1), 2),
        ((0, 1e6), 2),
        ((30, math.nan), 2),
        ((30, -5), 2),
        ((30, math.inf), 2),
        ((30, 4e9), 2),
        ((30, 1e30), 2),
        ((math.nan, 1e5), 2),
        ((7777, 1e5), 3),
        ((1.5, 1), 2),
    ],
)
def test_wrong_intervals_are_refused(bench, values, result):
    assert bench.command(511, *values) == result
    bench.fly(1.1)
    assert bench.taken("HEARTBEAT")


def test_request_message(bench):
    for number, name in ((30, "ATTITUDE"), (242, "HOME_POSITION"), (148, "AUTOPILOT_VERSION"), (0, "HEARTBEAT")):
        assert bench.command(512, number) == 0
        assert bench.answer[1].get_type() == name
    version = bench.answer
    assert bench.command(512, 148) == 0
    version = bench.answer[1]
    assert version.flight_sw_version == 0x01020300
    assert version.capabilities & 0x2010 == 0x2010
    assert not version.capabilities & 0x20  # no FTP
    for number, result in ((397, 3), (395, 3), (300, 3), (-1, 2), (math.nan, 2), (1e9, 2)):
        assert bench.command(512, number) == result
    assert bench.command(520, 1.0) == 0
    assert bench.answer[1].get_type() == "AUTOPILOT_VERSION"


def test_command_int_is_the_same(bench):
    bench.taken()
    bench.send(dialect.MAVLink_command_int_message(1, 1, 0, 400, 0, 0, 1.0, 0, 0, 0, 0, 0, 0))
    assert [ack.result for ack in bench.taken("COMMAND_ACK")] == [0]
    assert bench.vehicle.state.armed


def test_the_longest_interval_can_be_asked_for(bench):
    """MESSAGE_INTERVAL counts microseconds in 32 bits."""
    assert bench.command(511, 30, 2147483520.0) == 0
    assert bench.command(510, 30) == 0
    assert bench.answer[1].interval_us == 2147483520


def test_a_command_int_leaves_numbers_open_with_the_largest_one(bench):
    bench.taken()
    left_open = 2**31 - 1
    bench.send(
        dialect.MAVLink_command_int_message(
            1, 1, 0, 187, 0, 0, 1.0, math.nan, math.nan, math.nan, left_open, left_open, 0
        )
    )
    assert [ack.result for ack in bench.taken("COMMAND_ACK")] == [0]


def test_other_targets_are_met_with_silence(bench):
    bench.taken()
    for system, component in ((2, 1), (1, 190)):
        bench.send(dialect.MAVLink_command_long_message(system, component, 400, 0, 1, 0, 0, 0, 0, 0, 0))
        bench.send(dialect.MAVLink_param_request_list_message(system, component))
    elsewhere = manual(x=500)
    elsewhere.target = 2
    bench.send(elsewhere)
    assert bench.taken() == []
    assert not bench.vehicle.state.armed
    assert bench.exchange.read_sticks().sequence == 0
    bench.send(dialect.MAVLink_command_long_message(0, 0, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    assert bench.vehicle.state.armed


def parameters(bench):
    bench.send(dialect.MAVLink_param_request_list_message(1, 1))
    bench.taken()
    bench.fly(0.5)
    return bench.taken("PARAM_VALUE")


def test_parameters_are_listed_whole(bench):
    listed = parameters(bench)
    count = listed[0].param_count
    assert [value.param_index for value in listed] == list(range(count))
    names = [value.param_id for value in listed]
    assert {value.param_type for value in listed} == {9}
    assert all(len(name) <= 16 and name.startswith("XV_") for name in names)
    assert {"XV_RESET", "XV_NAC_CMD", "XV_NAC_MODE", "XV_NAC_RATE", "XV_MC_LOSS_T", "XV_SAS"} <= set(names)
    assert names == sorted(names)


def test_parameters_are_read_by_name_and_index(bench):
    bench.send(dialect.MAVLink_param_request_read_message(1, 1, b"XV_NAC_RATE", -1))
    by_name = bench.taken("PARAM_VALUE")[0]
    bench.send(dialect.MAVLink_param_request_read_message(1, 1, b"", by_name.param_index))
    assert bench.taken("PARAM_VALUE")[0].param_id == "XV_NAC_RATE"
    bench.send(dialect.MAVLink_param_request_read_message(1, 1, b"NOT_THERE", -1))
    bench.send(dialect.MAVLink_param_request_read_message(1, 1, b"", 9999))
    assert [message.get_type() for message in bench.taken()] == ["PARAM_ERROR", "PARAM_ERROR"]


def set_parameter(bench, name, value, kind=9, **options):
    bench.taken()
    bench.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, kind), **options)
    return [message.param_value for message in bench.taken("PARAM_VALUE", options.get("address", GROUND))]


def test_parameters_are_set_and_checked(bench):
    assert set_parameter(bench, "XV_NAC_RATE", 3.0) == [3.0]
    assert bench.requests() == [Request("parameter", "XV_NAC_RATE", 3.0)]
    for wrong in (99.0, -1.0, math.nan, math.inf, -3.4e38):
        assert set_parameter(bench, "XV_NAC_RATE", wrong) == [3.0]
    assert set_parameter(bench, "XV_NAC_MODE", 0.5) == [0.0]
    assert set_parameter(bench, "XV_NAC_RATE", 4.0, kind=6) == [3.0]
    assert set_parameter(bench, "NOT_THERE", 1.0) == []
    assert set_parameter(bench, "XV_STK_DEAD", float(np.float32(0.3))) == [pytest.approx(0.3)]
    assert bench.requests() == [Request("parameter", "XV_STK_DEAD", 0.3)]


def test_a_changed_parameter_is_told_to_everybody(bench):
    bench.join(OTHER)
    bench.sent.clear()
    set_parameter(bench, "XV_NAC_RATE", 5.0)
    assert [message.param_value for message in bench.taken("PARAM_VALUE", OTHER)] == [5.0]


def test_commands_set_after_a_reset_was_asked_for_are_not_put_back_by_it(bench):
    """Set before it, they say where the flight starts; set after it, they act, whenever the reset is seen."""
    bench.signals["flap_deg"] = 40.0
    bench.fly(0.1)
    store = bench.vehicle.store
    for name, value in (("XV_FLAP_CMD", 75.0), ("XV_THR_TRIM", 5.0), ("XV_RESET", 1.0), ("XV_THR_TRIM", 2.0)):
        bench.send(dialect.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
    bench.time_s, bench.frame = 0.0, 0
    bench.fly(0.1)
    assert (store["XV_FLAP_CMD"], store["XV_THR_TRIM"]) == (40.0, 2.0)
    bench.time_s, bench.frame = 0.0, 0  # by a key of the flight's own terminal
    bench.fly(0.1)
    assert store["XV_THR_TRIM"] == 0.0


def test_reset_nacelle_pilot_and_aids_are_parameters(bench):
    assert set_parameter(bench, "XV_RESET", 1.0) == [0.0]
    assert set_parameter(bench, "XV_NAC_CMD", 75.0) == [75.0]
    assert set_parameter(bench, "XV_PILOT", 0.0) == [0.0]
    assert set_parameter(bench, "XV_SAS", 0.0) == [0.0]
    reset, nacelle, pilot, aid = bench.requests()
    assert reset == Request("reset")
    assert math.degrees(nacelle.value) == pytest.approx(75.0)
    assert pilot == Request("pilot", "mocm")
    assert aid == Request("aid", "rate_damping", 0.0)


def test_parameters_follow_what_the_flight_really_does(bench):
    bench.taken()
    bench.feedback = bench.feedback._replace(aids=2.0)
    bench.fly(0.4)
    assert ("XV_SAS", 0.0) in [(message.param_id, message.param_value) for message in bench.taken("PARAM_VALUE")]


def test_parameters_are_stored_on_request(tmp_path):
    file = tmp_path / "deep" / "parameters.toml"
    bench = Bench(parameter_file=str(file))
    bench.fly(0.1)
    set_parameter(bench, "XV_NAC_RATE", 2.5)
    set_parameter(bench, "XV_NAC_CMD", 30.0)
    assert bench.command(245, 1.0) == 0
    bench.close()
    text = file.read_text()
    assert "XV_NAC_RATE = 2.5" in text
    assert "XV_NAC_CMD" not in text
    again = Bench(parameter_file=str(file))
    assert again.vehicle.store["XV_NAC_RATE"] == 2.5
    assert again.requests() == [Request("parameter", "XV_NAC_RATE", 2.5)]
    again.fly(0.1)
    assert again.command(245, 2.0) == 0
    assert again.vehicle.store["XV_NAC_RATE"] == 7.5
    assert again.command(245, 0.0) == 0
    assert again.vehicle.store["XV_NAC_RATE"] == 2.5
    again.close()
    file.write_text("XV_NAC_RATE = 99.0\nXV_STK_EXPO = 0.5\n")
    wrong = Bench(parameter_file=str(file))
    assert wrong.vehicle.store["XV_NAC_RATE"] == 7.5
    assert wrong.vehicle.store["XV_STK_EXPO"] == 0.0
    wrong.fly(0.1)
    assert any("not loaded" in text for text in wrong.texts())
    wrong.close()


def test_storage_without_a_file_is_unsupported(bench):
    assert bench.command(245, 1.0) == 3


def test_manual_control_axes(bench):
    bench.send(manual(x=250, z=700, y=-300, r=1000))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick, sticks.lever, sticks.lateral, sticks.yaw) == (0.25, 0.7, -0.3, 1.0)
    assert sticks.stick_valid
    assert sticks.lever_valid
    assert sticks.received_ns == int(bench.now * 1e9)
    assert sticks.owner == 255 << 8 | 190
    assert math.isnan(sticks.nacelle_angle)


def test_lateral_axes_are_held_lost_and_given_back_like_the_stick(bench):
    bench.send(manual(y=-300, r=400))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral_valid, sticks.yaw_valid, sticks.held) == (True, True, True)
    for _ in range(40):
        bench.fly(0.02)
        bench.send(manual(y=32767, r=400))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral_valid, sticks.lateral, sticks.yaw_valid, sticks.yaw) == (False, 0.0, True, 0.4)


def test_lateral_override_channels_are_held_taken_and_released(bench):
    bench.send(manual(y=100, r=100))
    bench.send(override(1750, 65535, 65535, 1250))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral, sticks.yaw, sticks.overridden) == (0.5, -0.5, 8 | 16)
    bench.send(override(0, 65535, 65535, 65535))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral, sticks.yaw, sticks.overridden) == (0.1, -0.5, 16)
    bench.send(override(65535, 65535, 65535, 0))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral_valid, sticks.yaw_valid, sticks.overridden) == (True, True, 0)


def test_a_channel_alone_is_a_hand_on_it(bench):
    bench.send(override(1750))
    sticks = bench.exchange.read_sticks()
    assert (sticks.held, sticks.lateral_valid, sticks.stick_valid, sticks.yaw_valid) == (True, True, False, False)


def test_the_sticks_as_applied_are_told_back(bench):
    """Those of the hands while they fly, else those that act."""
    bench.feedback = bench.feedback._replace(lateral=-0.25, yaw=0.5)
    bench.signals |= {"lateral_stick": 0.1, "pedal": -0.1, "pilot_mode": 1.0}
    bench.taken()
    bench.fly(0.3)
    channels = bench.taken("RC_CHANNELS")[-1]
    assert (channels.chan1_raw, channels.chan4_raw) == (1375, 1750)
    bench.signals["pilot_mode"] = 0.0
    bench.fly(0.3)
    sent = bench.taken()
    channels = [message for message in sent if message.get_type() == "RC_CHANNELS"][-1]
    assert (channels.chan1_raw, channels.chan4_raw) == (1550, 1450)
    arrays = [message for message in sent if message.get_type() == "DEBUG_FLOAT_ARRAY"]
    assert arrays[-1].data[12:14] == pytest.approx([0.1, -0.1])


def test_bad_axes_keep_the_last_good_value(bench):
    bench.send(manual(x=250, z=700))
    bench.send(manual(x=32767, z=-1000))
    bench.send(manual(x=-32768, z=1001))
    sticks = bench.exchange.read_sticks()
    assert (sticks.sequence, sticks.stick, sticks.lever) == (3, 0.25, 0.7)
    assert bench.vehicle.reader.ignored_axes == 4


@pytest.mark.parametrize("bad", [32767, 1001, -32768])
def test_an_extension_axis_keeps_its_last_good_value(bench, bad):
    bench.send(manual(enabled_extensions=4, aux1=1000))
    bench.send(manual(enabled_extensions=4, aux1=bad))
    assert math.degrees(bench.exchange.read_sticks().nacelle_angle) == pytest.approx(90.0)
    assert bench.vehicle.reader.ignored_axes == 1


def test_an_axis_without_a_good_value_is_lost_alone(bench):
    bench.send(manual(x=300, z=700, enabled_extensions=4, aux1=1000))
    for _ in range(40):
        bench.fly(0.02)
        bench.send(manual(x=32767, z=700, enabled_extensions=4, aux1=32767))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick_valid, sticks.lever_valid, sticks.lever) == (False, True, 0.7)
    assert math.isnan(sticks.nacelle_angle)


def test_an_overridden_nacelle_axis_is_another_source(bench):
    bench.send(manual(enabled_extensions=4, aux1=1000))
    bench.send(override(65535, 65535, 65535, 65535, 65535, 1500))
    sticks = bench.exchange.read_sticks()
    assert (math.degrees(sticks.nacelle_angle), sticks.overridden) == (pytest.approx(45.0), 4)
    bench.send(override(65535, 65535, 65535, 65535, 65535, 0))
    sticks = bench.exchange.read_sticks()
    assert (math.degrees(sticks.nacelle_angle), sticks.overridden) == (pytest.approx(90.0), 0)


def test_an_axis_never_given_is_nobodys(bench):
    bench.send(manual(x=32767, z=500))
    sticks = bench.exchange.read_sticks()
    assert not sticks.stick_valid
    assert sticks.lever_valid


def test_bipolar_lever_is_a_parameter(bench):
    set_parameter(bench, "XV_Z_BIPOLAR", 1.0)
    for z, lever in ((-1000, 0.0), (0, 0.5), (1000, 1.0)):
        bench.send(manual(z=z))
        assert bench.exchange.read_sticks().lever == lever


def test_buttons(bench):
    for buttons, switch in ((1 << 4, 1), (1 << 5, -1), (3 << 4, 0), (0, 0)):
        bench.send(manual(buttons=buttons))
        assert bench.exchange.read_sticks().nacelle_switch == switch
    for buttons, trim in ((1 << 11, 1), (1 << 12, -1), (3 << 11, 0)):
        bench.send(manual(buttons=buttons))
        assert bench.exchange.read_sticks().trim == trim
    bench.requests()
    for _ in range(3):
        bench.send(manual(buttons=1 << 6))
    bench.send(manual())
    bench.send(manual(buttons=1 << 6 | 1 << 9))
    assert bench.requests() == [
        Request("aid", "rate_damping", 2.0),
        Request("aid", "rate_damping", 2.0),
        Request("pilot", "next"),
    ]
    for more, trim in ((1, -1), (2, 1), (3, 0), (0, 0)):
        bench.send(manual(buttons2=more))
        assert bench.exchange.read_sticks().lateral_trim == trim
    bench.send(manual(buttons2=1 << 3))
    assert bench.exchange.read_sticks().buttons == 1 << 19


def test_absolute_nacelle_axis(bench):
    for aux, degrees in ((-1000, 0.0), (0, 45.0), (1000, 90.0)):
        bench.send(manual(enabled_extensions=4, aux1=aux))
        assert math.degrees(bench.exchange.read_sticks().nacelle_angle) == pytest.approx(degrees)
    bench.send(manual(enabled_extensions=3, aux1=500))
    assert math.isnan(bench.exchange.read_sticks().nacelle_angle)


def test_axis_map_and_button_map():
    bench = Bench(axes={"stick": "-r", "lever": "-z", "lateral": "", "nacelle": "s"}, buttons={"nacelle_aft": 20})
    bench.send(manual(r=400, z=300, x=999, y=999, enabled_extensions=1, s=1000, buttons2=1 << 4))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick, sticks.lever, sticks.lateral, sticks.nacelle_switch) == (-0.4, 0.7, 0.0, 1)
    assert math.degrees(sticks.nacelle_angle) == pytest.approx(90.0)
    bench.close()


def override(*channels, **options):
    return dialect.MAVLink_rc_channels_override_message(1, 1, *channels, *([65535] * (8 - len(channels))), **options)


def test_rc_override(bench):
    bench.send(override(1600, 1400, 1700, 1300, 1200, 1500))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lateral, sticks.stick, sticks.lever, sticks.yaw) == (0.2, 0.2, pytest.approx(0.7), -0.4)
    assert sticks.nacelle_switch == 1
    assert math.degrees(sticks.nacelle_angle) == pytest.approx(45.0)
    bench.send(override(65535, 65535, 2000, 65535, 1800, 65535))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick, sticks.lever, sticks.nacelle_switch) == (0.2, 1.0, -1)
    bench.send(override(0, 0, 0, 0, 0, 0))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick_valid, sticks.lever_valid, sticks.nacelle_switch) == (False, False, 0)
    assert math.isnan(sticks.nacelle_angle)
    bench.send(override(3000, 100, 1500))
    assert not bench.exchange.read_sticks().stick_valid
    assert bench.vehicle.reader.ignored_axes == 2


NOT_OURS = {f"chan{number}_raw": 1500 for number in range(9, 19)}
"""What QGroundControl sends beside MANUAL_CONTROL: channels from 9 on."""


@pytest.mark.parametrize("ignored", [[65535] * 8, [65534] * 8, [65535, 0, 65534, 0, 65535, 65535, 1700, 1200]])
def test_an_override_that_carries_none_of_our_channels_touches_nothing(bench, ignored):
    """A held button acts once, held trim and axes go on, and it neither takes the sticks nor keeps them alive."""
    bench.send(override(*ignored, **NOT_OURS), address=OTHER)
    assert bench.vehicle.lock.owner is None
    assert bench.exchange.read_sticks().sequence == 0
    for number in range(50):
        bench.send(manual(x=300, z=700, buttons=1 << 6 | 1 << 9 | 1 << 11 | 1 << 5))
        bench.send(override(*ignored, **NOT_OURS))
        sticks = bench.exchange.read_sticks()
        assert (sticks.stick, sticks.lever, sticks.trim, sticks.nacelle_switch) == (0.3, 0.7, 1, -1), number
        bench.fly(0.02)
    assert bench.requests() == [Request("aid", "rate_damping", 2.0), Request("pilot", "next")]
    last = bench.exchange.read_sticks().received_ns
    for _ in range(50):
        bench.fly(0.06)
        bench.send(override(*ignored, **NOT_OURS))
    assert bench.exchange.read_sticks().received_ns == last
    assert bench.vehicle.lock.owner is None


def test_an_override_takes_the_channels_it_carries_and_gives_them_back(bench):
    bench.send(manual(x=300, z=700, buttons=1 << 4))
    bench.send(override(65535, 65535, 1400))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick, sticks.lever, sticks.nacelle_switch) == (0.3, pytest.approx(0.4), 1)
    assert sticks.overridden == 2
    bench.send(manual(x=310, z=710))
    assert bench.exchange.read_sticks().lever == pytest.approx(0.4)
    bench.send(override(65535, 65535, 0))
    sticks = bench.exchange.read_sticks()
    assert (sticks.lever, sticks.overridden) == (0.71, 0)
    bench.send(override(65535, 65535, 1400))
    bench.fly(0.6)  # an override that is not repeated ends
    bench.send(manual(x=310, z=720))
    assert bench.exchange.read_sticks().lever == 0.72


def test_a_channel_or_button_that_is_no_longer_sent_ends_though_others_go_on(bench):
    bench.send(manual(x=300, z=700, buttons=1 << 5))
    bench.send(override(65535, 1400, 1600))
    for _ in range(40):
        bench.fly(0.02)
        bench.send(override(65535, 65535, 1600))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick_valid, sticks.lever_valid, sticks.nacelle_switch, sticks.buttons) == (False, True, 0, 0)


def test_another_pilot_and_input_that_is_back_are_other_streams(bench):
    bench.send(manual())
    streams = [bench.exchange.read_sticks().stream]
    bench.fly(0.1)
    bench.send(manual())
    assert bench.exchange.read_sticks().stream == streams[0] > 0
    bench.fly(0.7)
    bench.send(manual())
    streams.append(bench.exchange.read_sticks().stream)
    bench.fly(2.2)
    bench.send(manual(), address=OTHER)
    streams.append(bench.exchange.read_sticks().stream)
    assert len(set(streams)) == 3


def test_another_range_of_the_lever_is_another_hand(bench):
    bench.send(manual(z=700))
    before = bench.exchange.read_sticks().stream
    bench.fly(0.1)
    set_parameter(bench, "XV_Z_BIPOLAR", 1.0)
    bench.send(manual(z=700))
    assert bench.exchange.read_sticks().stream != before


def test_controls_that_wait_for_their_hand_are_told(bench):
    bench.feedback = bench.feedback._replace(waiting=3.0, lever=0.73)
    bench.fly(1.0)
    texts = bench.texts()
    assert any("Lever stays at 73 %" in text for text in texts)
    assert any("centre yours" in text for text in texts)


def test_the_first_pilot_owns_the_sticks_until_it_is_silent(bench):
    bench.send(manual(x=100))
    bench.send(manual(x=900), address=OTHER)  # the same ids from another address are another program
    bench.send(manual(x=800), component=191)
    assert bench.exchange.read_sticks().stick == 0.1
    bench.fly(2.2)
    assert any("held by 255/190" in text for text in bench.texts())
    bench.send(manual(x=900), address=OTHER)
    assert bench.exchange.read_sticks().stick == 0.9


def test_a_new_pilot_does_not_inherit_axes_or_buttons(bench):
    bench.send(manual(x=600, z=300, buttons=1 << 9))
    bench.requests()
    bench.fly(2.2)
    channels = dict.fromkeys((f"chan{number}_raw" for number in range(1, 9)), 65535) | {"chan3_raw": 1700}
    bench.send(dialect.MAVLink_rc_channels_override_message(1, 1, **channels), address=OTHER)
    sticks = bench.exchange.read_sticks()
    assert sticks.lever == pytest.approx(0.7)
    assert not sticks.stick_valid
    bench.fly(2.2)
    bench.send(manual(buttons=1 << 9))
    assert bench.requests() == [Request("pilot", "next")]


def test_after_a_loss_an_axis_counts_when_it_is_heard_again(bench):
    bench.send(manual(x=600, z=300, buttons=1 << 9))
    bench.requests()
    bench.fly(1.0)
    bench.send(manual(x=32767, z=400, buttons=1 << 9))
    sticks = bench.exchange.read_sticks()
    assert (sticks.stick_valid, sticks.lever_valid, sticks.lever) == (False, True, 0.4)
    assert bench.requests() == []  # the button never went up
    bench.send(manual(x=-100, z=400))
    assert bench.exchange.read_sticks().stick == -0.1


def test_only_listed_systems_may_fly_or_change_things(bench):
    bench.send(manual(x=500), system=42, address=OTHER)
    assert bench.exchange.read_sticks().sequence == 0
    assert bench.command(400, 1.0, system=42) == 2
    assert bench.command(3000, 4.0, system=42) == 2
    assert set_parameter(bench, "XV_NAC_RATE", 2.0, system=42) == [7.5]
    assert bench.command(512, 30.0, system=42) == 0
    assert bench.requests() == []


def test_loss_and_recovery_are_told(bench):
    assert bench.command(400, 1.0, 21196.0) == 0
    bench.fly(1.0)
    bench.taken()
    bench.feedback = bench.feedback._replace(input_state=2.0)
    bench.fly(0.6)
    messages = bench.taken()
    texts = [(m.severity, m.text) for m in messages if m.get_type() == "STATUSTEXT"]
    assert [severity for severity, text in texts if "lost" in text] == [4]
    assert next(m.system_status for m in messages if m.get_type() == "HEARTBEAT") == dialect.MAV_STATE_CRITICAL
    assert not [m for m in messages if m.get_type() == "SYS_STATUS"][-1].onboard_control_sensors_health & 0x10000
    bench.feedback = bench.feedback._replace(input_state=1.0)
    bench.fly(0.6)
    messages = bench.taken()
    assert any("regained" in m.text for m in messages if m.get_type() == "STATUSTEXT")
    assert next(m.system_status for m in messages if m.get_type() == "HEARTBEAT") == dialect.MAV_STATE_ACTIVE


def test_corridor_and_limits_warn_once_with_hysteresis(bench):
    bench.fly(5.0)
    bench.texts()
    bench.signals |= {"corridor_level": 2.0, "margin_kt": 3.0, "margin_low_kt": 3.0, "flapping_deg": 10.5}
    bench.fly(3.0)
    bench.signals["flapping_deg"] = 9.5
    bench.fly(1.0)
    bench.signals["flapping_deg"] = 10.5
    bench.fly(1.0)
    texts = bench.texts()
    assert sum("too slow" in text for text in texts) == 1
    assert sum("Flapping" in text for text in texts) == 1
    bench.signals |= {"corridor_level": 0.0}
    bench.fly(1.0)
    assert "Corridor clear" in bench.texts()


def test_texts_are_short_and_seldom(bench):
    bench.fly(10.0)
    bench.texts()
    for number in range(200):
        bench.vehicle.board.say(6, f"{number} " + "x" * 80)
    bench.fly(4.0)
    texts = bench.texts()
    assert all(len(text) <= 50 for text in texts)
    assert len(texts) <= 4 + 2 * 4 + 1


def test_waiting_sticks_and_pedals_are_told(bench):
    for bits, words in ((4, "Lateral stick stays centred"), (8, "Pedals stay centred"), (1, "Stick stays at trim")):
        bench.feedback = bench.feedback._replace(waiting=float(bits))
        bench.fly(1.0)
        assert [text for text in bench.texts() if words in text], words
        bench.feedback = bench.feedback._replace(waiting=0.0)
        bench.fly(1.0)


def test_timesync_ping_missions_and_files(bench):
    bench.taken()
    bench.send(dialect.MAVLink_timesync_message(0, 123_456))
    sync = bench.taken("TIMESYNC")[0]
    assert sync.ts1 == 123_456
    assert sync.tc1 == pytest.approx(bench.vehicle.state.boot_s * 1e9, abs=1e7)
    bench.send(dialect.MAVLink_timesync_message(5, 6))
    bench.send(dialect.MAVLink_ping_message(77, 5, 0, 0))
    ping = bench.taken()[0]
    assert (ping.time_usec, ping.seq, ping.target_system, ping.target_component) == (77, 5, 255, 190)
    for kind in (0, 1, 2):
        bench.send(dialect.MAVLink_mission_request_list_message(1, 1, kind))
        count = bench.taken("MISSION_COUNT")[0]
        assert (count.count, count.mission_type, count.target_system) == (0, kind, 255)
    bench.send(dialect.MAVLink_mission_count_message(1, 1, 5))
    assert bench.taken("MISSION_ACK")[0].type == dialect.MAV_MISSION_UNSUPPORTED
    bench.send(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, [7, 0, 0, 4, 0, 0] + [0] * 245))
    answer = bench.taken("FILE_TRANSFER_PROTOCOL")[0]
    assert (answer.payload[0], answer.payload[3], answer.payload[5]) == (8, 129, 4)


@pytest.mark.parametrize(
    ("request_message", "answer", "told"),
    [
        (dialect.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF), "LOG_ENTRY", {"num_logs": 0, "last_log_num": 0}),
        (dialect.MAVLink_log_request_data_message(1, 1, 3, 90, 900), "LOG_DATA", {"id": 3, "ofs": 90, "count": 0}),
        (dialect.MAVLink_param_ext_request_list_message(1, 1), "PARAM_EXT_VALUE", {"param_count": 0}),
        (dialect.MAVLink_mission_write_partial_list_message(1, 1, 0, 3), "MISSION_ACK", {"type": 3}),
        (dialect.MAVLink_autopilot_version_request_message(1, 1), "AUTOPILOT_VERSION", {}),
    ],
)
def test_what_there_is_none_of_is_said_at_once(bench, request_message, answer, told):
    bench.taken()
    bench.send(request_message)
    (message,) = bench.taken(answer)
    assert {name: getattr(message, name) for name in told} == told


def test_garbage_makes_no_peer_and_gets_no_answer(bench):
    bench.sent.clear()
    rng = np.random.default_rng(1)
    for _ in range(300):
        bench.receive(rng.bytes(int(rng.integers(1, 300))), OTHER)
        bench.receive(b"\xfd" + rng.bytes(40), OTHER)
    assert bench.sent == []
    assert OTHER not in bench.vehicle.peers.by_address


def test_with_a_key_an_unsigned_radio_earns_no_telemetry(tmp_path):
    file = tmp_path / "key"
    file.write_text("11" * 32)
    file.chmod(0o600)
    bench = Bench(signing_key_file=str(file))
    bench.sent.clear()
    bench.send(dialect.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1), address=OTHER)
    bench.fly(0.1)
    assert OTHER not in bench.vehicle.peers.by_address
    assert all(to != OTHER for _, to in bench.sent)


def test_own_ids_are_not_a_station(bench):
    bench.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), system=1, component=1, address=OTHER)
    assert OTHER not in bench.vehicle.peers.by_address


def test_stations_are_few_and_forgotten_when_silent(bench):
    for port in range(20):
        bench.join(("127.0.0.1", 20_000 + port))
    assert len(bench.vehicle.peers.by_address) == MOST_PEERS + 1
    bench.fly(11.0)
    assert set(bench.vehicle.peers.by_address) == {GROUND}  # the configured target stays
    assert bench.vehicle.peers.strangers == {}


def earned(bench, address):
    return sum(len(data) for data, to in bench.sent if to == address)


@pytest.mark.parametrize("host", ["127.0.0.1", "192.0.2.7"])
@pytest.mark.parametrize("kind", ["heartbeat", "list", "commands", "sticks"])
def test_an_address_that_answers_nothing_earns_three_bytes_for_each(bench, host, kind):
    """Whoever sends in its name: one packet, or one a second for ever (heartbeats), or one burst of requests."""
    address = (host, 5555)
    messages = {
        "heartbeat": [HEARTBEAT] * 20,
        "list": [dialect.MAVLink_param_request_list_message(1, 1)] * 20,
        "commands": [
            dialect.MAVLink_command_long_message(1, 1, 512, 0, float(number), *[0.0] * 6) for number in (148, 435)
        ]
        * 10,
        "sticks": [manual()],
    }[kind]
    spent = 0
    for number, message in enumerate(messages):
        spent += len(message.pack(dialect.MAVLink(None)))
        bench.send(message, address=address)
        bench.fly(0.9 if kind == "heartbeat" else 0.02)
        assert earned(bench, address) <= 3 * spent, number
    bench.fly(12.0)
    assert earned(bench, address) <= 3 * spent
    assert address not in bench.vehicle.peers.by_address


def test_a_station_that_answers_our_ping_is_served_at_once(bench):
    address = ("192.0.2.7", 14550)
    came = bench.join(address, answer=False)
    assert came[0].get_type() == "HEARTBEAT"
    ping = came[-1]
    for wrong in ((ping.time_usec ^ 1, ping.seq), (0, 0)):
        bench.send(dialect.MAVLink_ping_message(*wrong, 1, 1), address=address)
    other = ("192.0.2.8", 14550)  # what one address was told is worth nothing at another
    bench.send(dialect.MAVLink_ping_message(ping.time_usec, ping.seq, 1, 1), address=other)
    assert set(bench.vehicle.peers.by_address) == {GROUND}
    bench.send(dialect.MAVLink_ping_message(ping.time_usec, ping.seq, 1, 1), address=address)
    bench.fly(0.1)
    assert len(bench.taken("ATTITUDE", address)) >= 4


def test_a_program_of_this_machine_that_talks_on_is_served(bench):
    """A script that answers no PING: heartbeats and a request, as all of them send."""
    for _ in range(3):
        bench.send(HEARTBEAT, address=OTHER)
        bench.send(dialect.MAVLink_param_request_list_message(1, 1), address=OTHER)
        bench.fly(0.6)
    bench.fly(0.5)
    names = {message.get_type() for message in bench.taken(address=OTHER)}
    assert {"ATTITUDE", "PARAM_VALUE"} <= names
    bench.fly(4.0)
    assert OTHER not in bench.vehicle.peers.by_address  # and no longer than it talks


def test_strangers_crowd_out_nobody(bench):
    bench.join(OTHER)
    bench.sent.clear()
    for number in range(3000):
        bench.send(HEARTBEAT, address=("127.0.0.1", 20_000 + number))
        if number % 100 == 0:
            bench.fly(0.02)
            bench.send(HEARTBEAT, address=OTHER)
    late = ("127.0.0.1", 15_000)
    while late not in bench.vehicle.peers.by_address:  # its group may be used up for a moment
        bench.fly(0.1)
        bench.send(HEARTBEAT, address=late)
        for ping in bench.taken("PING", late):
            bench.send(dialect.MAVLink_ping_message(ping.time_usec, ping.seq, 1, 1), address=late)
        assert bench.now < 1010.0
    assert {GROUND, OTHER, late} == set(bench.vehicle.peers.by_address)
    assert len(bench.vehicle.peers.strangers) <= 32
    bench.sent.clear()
    bench.fly(1.0)
    assert len(bench.taken("ATTITUDE", OTHER)) == pytest.approx(50, abs=2)


def test_rates_are_for_stations_and_a_station_has_a_budget(bench):
    bench.send(HEARTBEAT, address=OTHER)
    bench.fly(0.5)
    assert bench.command(511, 30.0, 4000.0, address=OTHER) == 1
    assert bench.command(511, 30.0, 4000.0, system=42) == 2
    bench.fly(1.0)
    for number in (30, 31, 32, 33, 74, 251, 350, 65, 36, 141, 24, 147, 242, 231, 2, 436, 1, 245):
        assert bench.command(511, float(number), 1.0) == 0
    bench.sent.clear()
    bench.vehicle.peers.by_address[GROUND].volume.take(bench.now, 90_000.0)
    for _ in range(1000):
        bench.now += 0.004
        bench.vehicle.tick(bench.now)
    assert earned(bench, GROUND) <= 4.0 * 100_000 + 20_000
    assert len(bench.taken("HEARTBEAT")) >= 3


@pytest.mark.parametrize(("system", "component"), [(1, 1), (1, 191), (0, 190)])
def test_a_sender_that_is_ignored_is_told_once(bench, system, component):
    for _ in range(5):
        bench.send(manual(), system=system, component=component, address=OTHER)
        bench.fly(0.6)
    told = [f"Ignored 127.0.0.1:14999: system {system} is no station's id"]
    assert bench.exchange.take_notes() == told
    assert [text for text in bench.texts() if "Ignored" in text] == [told[0][:50]]
    assert bench.exchange.read_sticks().sequence == 0


def test_who_arms_and_who_flies_are_events_of_the_flight(bench):
    bench.command(400, 1.0)
    bench.send(manual())
    bench.fly(2.2)
    assert bench.exchange.take_notes() == ["Armed", "Sticks: 255/190", "Sticks free, 255/190 is silent"]


def test_a_system_that_may_not_fly_is_told_once(bench):
    for _ in range(5):
        bench.send(manual(), system=42, address=OTHER)
        bench.fly(3.0)
    assert bench.exchange.take_notes() == ["System 42 may not fly"]


def test_a_missing_ground_station_is_noticed(bench):
    bench.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    bench.fly(4.0)
    assert any("silent" in text for text in bench.texts())
    bench.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    bench.fly(1.0)
    assert any("back" in text for text in bench.texts())


def test_answers_are_budgeted(bench):
    bench.taken()
    for _ in range(2000):
        bench.send(dialect.MAVLink_ping_message(1, 1, 0, 0))
    assert len(bench.taken("PING")) <= 300


def test_sequence_numbers_are_whole_for_each_station(bench):
    bench.join(OTHER)
    bench.sent.clear()
    bench.command(511, 30.0, -1.0)
    bench.sent.clear()
    bench.fly(3.0)
    for address in (GROUND, OTHER):
        numbers = [message.get_seq() for message in bench.taken(address=address)]
        assert len(numbers) > 300
        assert all((after - before) % 256 == 1 for before, after in itertools.pairwise(numbers))


def test_nothing_that_does_not_fit_a_field_ends_the_vehicle(bench):
    bench.signals = dict.fromkeys(FLIGHT, 1e12)
    bench.fly(2.1)
    bench.signals = dict.fromkeys(FLIGHT, -1e12)
    bench.fly(2.1)
    bench.signals = dict.fromkeys(FLIGHT, math.nan)
    bench.fly(2.1)
    attitude = bench.taken("ATTITUDE")[-1]
    assert math.isfinite(attitude.pitch)


def test_a_flight_that_does_not_answer_is_told_and_not_shown_as_if_it_flew(bench):
    """Its process is stopped: no frames, and not the life sign of one that stands still on purpose."""
    header = bench.exchange.header

    def wait(seconds, *, lives):
        for _ in range(round(seconds / 0.02)):
            header[ALIVE] += lives
            bench.now += 0.02
            bench.vehicle.tick(bench.now)

    wait(2.0, lives=1)  # paused
    assert len(bench.taken("ATTITUDE")) > 90
    wait(1.1, lives=0)
    beat = bench.taken("HEARTBEAT")[-1]
    assert beat.system_status == dialect.MAV_STATE_EMERGENCY
    wait(2.5, lives=0)
    messages = bench.taken()
    assert {message.get_type() for message in messages} <= {"HEARTBEAT", "STATUSTEXT"}
    assert all(m.system_status == dialect.MAV_STATE_EMERGENCY for m in messages if m.get_type() == "HEARTBEAT")
    wait(0.5, lives=1)
    messages = bench.taken()
    assert any("answers again" in m.text for m in messages if m.get_type() == "STATUSTEXT")
    assert next(m for m in messages if m.get_type() == "HEARTBEAT").system_status == dialect.MAV_STATE_STANDBY
    assert "ATTITUDE" in {message.get_type() for message in messages}
    header[ALIVE] = 0  # over
    wait(5.0, lives=0)
    assert not bench.vehicle.state.stalled


def test_a_flight_in_slow_motion_is_not_taken_for_dead(bench):
    """Its frames are seconds apart."""
    told = []
    for frame in range(10):
        bench.exchange.header[ALIVE] += 1
        for _ in range(200):
            bench.now += 0.02
            bench.vehicle.tick(bench.now)
            told += [frame] * bench.vehicle.state.stalled
    assert set(told) <= {0}


def test_farewell(bench):
    bench.taken()
    bench.vehicle.farewell()
    messages = bench.taken()
    assert messages[-1].system_status == dialect.MAV_STATE_POWEROFF
