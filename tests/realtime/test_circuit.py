"""A hand that knows MAVLink alone flies a circuit by raw sticks; what clients see of it agrees with the sticks."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from rtsim.frame import COLUMN
from scenarios.flight.replay import replay_log
from telemetry.log.reader import read_log
from tests.ground_station import AFT, FORWARD, KNOT, turned

pytestmark = pytest.mark.realtime

GRAVITY = 9.80665
RUNWAY = math.radians(60.0)
UPWIND, CROSSWIND, DOWNWIND, BASE, FINAL = (RUNWAY + leg * math.pi / 2.0 for leg in range(5))


def clipped(value, low, high):
    return float(min(max(value, low), high))


@dataclass(frozen=True)
class Seen:
    """What a hand flies by."""

    time: float
    bank: float
    pitch: float
    heading: float
    roll_rate: float
    yaw_rate: float
    north: float
    east: float
    height: float
    ahead: float
    right: float
    climb: float
    nacelle_deg: float
    slip: float

    @classmethod
    def by(cls, station):
        """From the newest messages; the flight's own angle of the nacelles and of sideslip are in the array."""
        attitude, place, array = (
            station.last[name] for name in ("ATTITUDE", "LOCAL_POSITION_NED", "DEBUG_FLOAT_ARRAY")
        )
        cosine, sine = math.cos(attitude.yaw), math.sin(attitude.yaw)
        return cls(
            time=attitude.time_boot_ms / 1000.0,
            bank=attitude.roll,
            pitch=attitude.pitch,
            heading=attitude.yaw,
            roll_rate=attitude.rollspeed,
            yaw_rate=attitude.yawspeed,
            north=place.x,
            east=place.y,
            height=-place.z,
            ahead=place.vx * cosine + place.vy * sine,
            right=place.vy * cosine - place.vx * sine,
            climb=-place.vz,
            nacelle_deg=array.data[0],
            slip=math.radians(array.data[16]),
        )


def steer(seen, *, course, bank=None, off=0.0):
    """Lateral stick and pedals: by bank to a course with the ball in the middle, by pedals where it is slow.

    Args:
        seen: What is seen.
        course: Heading to take [rad].
        bank: Bank in place of that which takes the course [rad].
        off: Place right of where it shall be [m], in the hover.
    """
    slow = clipped((25.0 - seen.ahead) / 10.0, 0.0, 1.0)
    error = turned(course - seen.heading)
    most = math.radians(25.0 if seen.ahead > 33.0 else 12.0)
    turn = clipped(0.5 * error * max(seen.ahead, 1.0) / GRAVITY, -most, most)
    hover = clipped(-0.08 * seen.right - 0.012 * clipped(off, -10.0, 10.0), -0.12, 0.12)
    wanted = slow * hover + (1.0 - slow) * turn if bank is None else bank
    of_bank = (1.0 - slow) * GRAVITY * math.sin(seen.bank) / max(seen.ahead, 15.0)
    pedals = slow * clipped(1.6 * error, -0.8, 0.8) + 1.2 * (1.0 - slow) * seen.slip - 3.5 * (seen.yaw_rate - of_bank)
    stick = 1.9 * (wanted - seen.bank) - 1.2 * seen.roll_rate
    return clipped(stick, -0.5, 0.5), clipped(pedals, -0.6, 0.6)


class CircuitHand:
    """Off the ground, round by the pedals onto the runway's heading, a right-hand circuit, and down where it began."""

    def __init__(self, lever, seen):
        self.lever0, self.home, self.before = lever, (seen.north, seen.east), seen.time
        self.phase, self.height, self.phases = "rise", 15.0, ["rise"]
        self.reference = self.pull = self.lever_sum = self.pitch_sum = 0.0

    def _next(self, phase):
        self.phase = phase
        self.phases.append(phase)

    def step(self, seen):
        """Give MANUAL_CONTROL's x, z, buttons, y and r."""
        dt, self.before = seen.time - self.before, seen.time
        north, east = seen.north - self.home[0], seen.east - self.home[1]
        self.seen, self.along = seen, north * math.cos(RUNWAY) + east * math.sin(RUNWAY)
        self.across = east * math.cos(RUNWAY) - north * math.sin(RUNWAY)
        course, goal_kt = getattr(self, f"_{self.phase}")()
        lateral, pedals = steer(seen, course=course, off=self.across if self.phase in {"final", "land"} else 0.0)
        stick, lever = self._lengthways(seen, goal_kt, dt)
        axes = {"x": stick, "z": lever, "y": lateral, "r": pedals}
        return {name: round(1000.0 * value) for name, value in axes.items()} | {"buttons": self._nacelles(seen)}

    # Each phase: course [rad] and airspeed [kn] to fly, and what comes next.

    def _rise(self):
        if self.seen.height > 13.0:
            self._next("hover_turn")
        return 0.0, 0.0

    def _hover_turn(self):
        if abs(turned(RUNWAY - self.seen.heading)) < 0.03 and abs(self.seen.yaw_rate) < 0.02:
            self._next("upwind")
        return RUNWAY, 0.0

    def _upwind(self):
        self.height = 60.0
        if self.seen.ahead > 108.0 * KNOT:
            self._next("crosswind")
        return UPWIND, 110.0

    def _crosswind(self):
        fast = self.seen.ahead > 140.0 * KNOT and self.seen.nacelle_deg < 0.5
        if fast and abs(turned(CROSSWIND - self.seen.heading)) < 0.05:
            self._next("downwind")
        return CROSSWIND, 145.0

    def _downwind(self):
        if self.along < -700.0:
            self._next("base")
        return DOWNWIND, 100.0 if self.along < 700.0 else 145.0

    def _base(self):
        if self.across < self.seen.ahead**2 / (GRAVITY * math.tan(math.radians(22.0))) + 30.0:
            self._next("final")
        return BASE, 100.0 if self.across > 1000.0 else 75.0

    def _final(self):
        if self.along > -300.0:
            self.height = 15.0
        hovers = abs(self.seen.ahead) < 1.3 and self.seen.nacelle_deg > 89.5
        if hovers and abs(self.along) < 12.0 and abs(self.across) < 4.0:
            self._next("land")
        speed = min(75.0 * KNOT, math.sqrt(1.2 * max(-self.along - 10.0, 0.0)))
        if self.along > -40.0:
            speed = min(speed, -0.25 * self.along) if self.along < 0.0 else max(-2.0, -0.25 * self.along)
        aside = clipped(-self.across / max(8.0 * self.seen.ahead, 150.0), -0.4, 0.4) if self.seen.ahead > 15.0 else 0.0
        return FINAL + aside, speed / KNOT

    def _land(self):
        self.height = -1.0
        return FINAL, -0.25 * self.along / KNOT

    def _lengthways(self, seen, goal_kt, dt):
        """Stick and lever; with the nacelles up the lever holds the height, with them down the pitch does."""
        speed_kt = seen.ahead / KNOT
        near = clipped(self.reference, speed_kt - 8.0, speed_kt + 8.0)
        fastest = 3.0 if goal_kt > speed_kt else 2.3
        moved = clipped(goal_kt - near, -fastest * dt, fastest * dt)
        self.reference = near + moved
        self.pull += min(dt, 1.0) * ((moved / dt if dt else 0.0) - self.pull)
        error = self.reference - speed_kt
        wanted = clipped(0.25 * (self.height - seen.height), -0.8 if seen.height < 8.0 else -1.5, 2.0)
        if self.phase == "land":
            wanted = clipped(0.15 * (self.height - seen.height), -0.8, -0.25)
        climb = wanted - seen.climb
        share = clipped((seen.nacelle_deg - 30.0) / 40.0, 0.0, 1.0)  # 1: the lever holds the height, 0: the pitch
        self.lever_sum += dt * (0.04 * share * climb + 0.004 * (1.0 - share) * error)
        lever = self.lever0 + self.lever_sum + 0.06 * share * climb + 0.012 * (1.0 - share) * error
        self.pitch_sum += dt * (-0.06 * share * error + 0.8 * (1.0 - share) * climb)
        self.pitch_sum = clipped(self.pitch_sum, -8.0, 8.0)
        by_speed = -0.7 * error - (1.5 * self.pull if seen.nacelle_deg > 80.0 else 0.0)
        by_climb = 1.6 * climb + 25.0 * (1.0 / math.cos(seen.bank) - 1.0)
        pitch = clipped(1.0 + self.pitch_sum + share * by_speed + (1.0 - share) * by_climb, -9.0, 11.0)
        stick = 0.12 * (math.degrees(seen.pitch) - pitch)
        return clipped(stick, -0.6, 0.6), clipped(lever, 0.0, 1.0)

    def _nacelles(self, seen):
        """Buttons: the nacelles follow the speed that is asked for."""
        if self.phase in {"rise", "hover_turn", "land"}:
            return 0
        if self.phase in {"upwind", "crosswind"}:
            wanted = np.interp(self.reference, [0.0, 60.0, 100.0, 125.0, 140.0], [82.0, 75.0, 60.0, 30.0, 0.0])
            return FORWARD if seen.nacelle_deg > wanted + 0.3 else 0
        wanted = np.interp(self.reference, [30.0, 65.0, 100.0, 120.0, 135.0], [90.0, 75.0, 60.0, 30.0, 0.0])
        return AFT if seen.nacelle_deg < wanted - 0.3 else 0


STREAMS_MS = {
    dialect.MAVLink_attitude_message: 8.0,
    dialect.MAVLink_local_position_ned_message: 8.0,
    dialect.MAVLink_debug_float_array_message: 16.0,
    dialect.MAVLink_global_position_int_message: 24.0,
    dialect.MAVLink_gps_raw_int_message: 24.0,
    dialect.MAVLink_rc_channels_message: 24.0,
    dialect.MAVLink_attitude_quaternion_message: -1.0,
    dialect.MAVLink_named_value_float_message: -1.0,
}
"""The flight runs faster than the clock by which messages are sent; what the hand does not look at is stopped."""


def prepared(station, flight):
    """Wait for a flight and ask for its streams."""
    station.wait_for_flight(flight)
    for message, interval_ms in STREAMS_MS.items():
        station.ask_for(message, interval_ms)
    station.wait_for(lambda: {"DEBUG_FLOAT_ARRAY", "GPS_RAW_INT", "HOME_POSITION"} <= station.last.keys())
    return flight


def fly(station, flight, hand, send, *, timeout_s):
    """Let a hand act on each new attitude until it gives None; gives what was heard."""
    heard, before = [], -1
    end = time.monotonic() + timeout_s
    while flight.process.poll() is None:
        assert time.monotonic() < end, getattr(hand, "phases", "not in time")
        station.poll()
        now = station.last["ATTITUDE"].time_boot_ms
        if now > before:
            sticks = hand(Seen.by(station))
            if sticks is None:
                break
            send(**sticks)
            before = now
        heard += [message for _, message in station.heard]
        station.heard.clear()
        time.sleep(0.003)
    return heard


def series(heard, name, *fields):
    """Time [s] and fields of every message of a kind, in columns, each time once."""
    found = [message for message in heard if message.get_type() == name]
    stamps = [getattr(m, "time_boot_ms", None) or m.time_usec / 1000.0 for m in found]
    rows = np.array(
        [[stamp / 1000.0, *(getattr(m, f) for f in fields)] for stamp, m in zip(stamps, found, strict=True)]
    )
    return rows[np.concatenate([[True], np.diff(rows[:, 0]) > 0.0])].T


class Picture:
    """What a client knows of a flight when it is over, on the times of its positions."""

    def __init__(self, heard, origin):
        """Angles in rad; ``origin`` is the latitude [deg] of the start."""
        self.time, latitude, longitude, north, east, heading = series(
            heard, "GLOBAL_POSITION_INT", "lat", "lon", "vx", "vy", "hdg"
        )
        metres = 6_371_000.0 * math.pi / 180.0 * 1e-7
        self.north, self.east = latitude * metres, longitude * metres * math.cos(math.radians(origin))
        self.v_north, self.v_east = north / 100.0, east / 100.0
        self.heading = np.unwrap(np.radians(heading / 100.0))
        when, roll, yaw = series(heard, "ATTITUDE", "roll", "yaw")
        self.bank, self.yaw = self._at(when, roll), self._at(when, np.unwrap(yaw))
        when, course = series(heard, "GPS_RAW_INT", "cog")
        self.course = self._at(when, np.unwrap(np.radians(course / 100.0)))
        when, lateral, pedals = series(heard, "RC_CHANNELS", "chan1_raw", "chan4_raw")
        self.lateral, self.pedals = (self._at(when, raw / 500.0 - 3.0) for raw in (lateral, pedals))
        self.speed = np.hypot(self.v_north, self.v_east)

    def _at(self, when, values):
        return np.interp(self.time, when, values)

    def agrees(self, *, from_speed):
        """Position, velocity, track and heading say the same, and turns are those of their bank.

        Args:
            from_speed: Speed [m/s] from which a track is a track.

        Returns:
            Bank [rad] and turn rate [rad/s] where the turns were steady.
        """
        # One second on: what was flown over the ground is the velocity, its direction track and heading.
        later = np.searchsorted(self.time, self.time + 1.0)
        first = np.flatnonzero((later < self.time.size) & (self.speed > from_speed))
        last = later[first]
        seconds = self.time[last] - self.time[first]
        flown = (self.north[last] - self.north[first]) / seconds, (self.east[last] - self.east[first]) / seconds
        mean = [0.5 * (values[first] + values[last]) for values in (self.v_north, self.v_east, self.yaw, self.course)]
        assert np.hypot(flown[0] - mean[0], flown[1] - mean[1]).max() < 1.0
        track = np.arctan2(flown[1], flown[0])
        # A turn begins and ends with some sideslip: the aircraft points where it flies once it has been level a while.
        since = np.searchsorted(self.time, self.time[first] - 2.0)
        bank = np.array([np.abs(self.bank[one : two + 1]).max() for one, two in zip(since, last, strict=True)])
        level = bank < math.radians(2.0)
        assert np.count_nonzero(level) > 50
        off = np.degrees(np.abs(turned(track - mean[2])))
        assert np.median(off[level]) < 0.5
        assert off[level].max() < 3.0
        assert off.max() < 7.0
        assert np.degrees(np.abs(turned(track - mean[3]))).max() < 1.5
        assert np.degrees(np.abs(turned(self.heading - self.yaw))).max() < 1.0
        # A steady turn: for four seconds bank and speed stay, and the heading runs evenly.
        later = np.searchsorted(self.time, self.time + 4.0)
        steady = []
        for one in np.flatnonzero((later < self.time.size) & (np.abs(self.bank) > math.radians(8.0))):
            span, change = slice(one, later[one] + 1), self.yaw[later[one]] - self.yaw[one]
            even = np.interp(self.time[span], self.time[[one, later[one]]], self.yaw[[one, later[one]]])
            if (
                np.ptp(self.bank[span]) < math.radians(1.0)
                and np.ptp(self.speed[span]) < 2.0
                and np.abs(self.yaw[span] - even).max() < 0.02 * abs(change)
            ):
                steady.append((self.bank[span].mean(), self.speed[span].mean(), change / np.ptp(self.time[span])))
        assert len(steady) > 20
        bank, speed, rate = np.array(steady).T
        apart = np.abs(rate * speed / (GRAVITY * np.tan(bank)) - 1.0)
        assert np.median(apart) < 0.04  # the hand leaves up to 1 deg of sideslip, which bears some of the turn
        assert apart.max() < 0.10
        return bank, rate


@pytest.mark.slow
def test_a_hand_flies_a_circuit_by_raw_sticks_and_the_log_replays(start, station):
    """From the ground to the airplane and back to the place, four turns and one in the hover, no lateral aid on."""
    flight = prepared(
        station, start(station.port, "--speed", "8", "--altitude-m", "0", "--ground", "--duration", "500")
    )
    hand = CircuitHand((station.last["RC_CHANNELS"].chan3_raw - 1000) / 1000.0, Seen.by(station))
    rest = []

    def stands(seen):
        if hand.phase == "land" and seen.height < 0.25 and abs(seen.climb) < 0.05:
            rest.append(seen)
        return None if rest and seen.time > rest[0].time + 5.0 else hand.step(seen)

    heard = fly(station, flight, stands, station.sticks, timeout_s=150.0)
    home = station.last["HOME_POSITION"].latitude / 1e7
    summary = flight.end()
    assert hand.phases == ["rise", "hover_turn", "upwind", "crosswind", "downwind", "base", "final", "land"]
    assert summary["corridor"]["worst_margin_kt"] > 5.0
    assert summary["mavlink"]["faults"] == 0
    # What the client saw: once round, and back at the place.
    seen = Picture(heard, home)
    assert math.degrees(seen.yaw[-1] - seen.yaw[0]) == pytest.approx(420.0, abs=3.0)
    assert math.hypot(seen.north[-1] - seen.north[0], seen.east[-1] - seen.east[0]) < 8.0
    assert np.hypot(seen.north - seen.north[0], seen.east - seen.east[0]).max() > 2000.0
    bank, rate = seen.agrees(from_speed=15.0)
    assert bank.min() > 0.0
    assert rate.min() > 0.0
    # Pedals to the right turn the nose to the right, in the hover before anything else; the stick to the right banks.
    hover = np.argmax(seen.pedals > 0.1)
    assert abs(seen.bank[hover]) < 0.02
    assert seen.yaw[hover] - seen.yaw[0] < 0.1
    assert math.degrees(seen.yaw[np.argmax(seen.time > seen.time[hover] + 4.0)] - seen.yaw[hover]) > 15.0
    entry = np.argmax((seen.lateral > 0.2) & (seen.speed > 50.0))
    assert abs(math.degrees(seen.bank[entry])) < 5.0
    assert math.degrees(seen.bank[np.argmax(seen.time > seen.time[entry] + 1.5)]) > 10.0
    # What was flown, by the log.
    log = read_log(flight.log)
    flown = log.history
    assert any("touched down" in event.text for event in log.events)
    assert np.min(flown[:, COLUMN.nacelle_deg]) < 0.5
    assert np.max(flown[:, COLUMN.airspeed_kt]) > 140.0
    assert flown[-1, COLUMN.nacelle_deg] > 89.5
    assert flown[-1, COLUMN.weight_on_wheels] > 0.02
    result = replay_log(flight.log)
    assert result.same, result.difference
    assert result.stated_sha256 == summary["history_sha256"]


def test_a_short_turn_by_override(start, station):
    """Channels 1 and 4 bank and turn to the left; heading and track follow, and come back to straight flight."""
    flight = prepared(
        station,
        start(station.port, "--speed", "4", "--start", "conversion", "--altitude-m", "300", "--duration", "120"),
    )
    lever, begin = station.last["RC_CHANNELS"].chan3_raw, Seen.by(station).time

    def turn(seen):
        seconds = seen.time - begin
        bank = math.radians(-15.0) if 3.0 < seconds < 15.0 else 0.0
        lateral, pedals = steer(seen, course=seen.heading, bank=bank)
        channels = 1500.0 + 500.0 * lateral, 1500.0, lever, 1500.0 + 500.0 * pedals
        return {"channels": [round(value) for value in channels]} if seconds < 22.0 else None

    heard = fly(station, flight, turn, lambda channels: station.channels(*channels), timeout_s=60.0)
    home = station.last["HOME_POSITION"].latitude / 1e7
    summary = flight.end()
    seen = Picture(heard, home)
    bank, rate = seen.agrees(from_speed=15.0)
    assert np.degrees(bank).max() < -10.0
    assert rate.max() < 0.0
    turned_deg, track_deg = (math.degrees(values[-1] - values[0]) for values in (seen.yaw, seen.course))
    assert turned_deg == pytest.approx(-12.0 * math.degrees(GRAVITY * math.tan(math.radians(15.0)) / 41.2), rel=0.2)
    assert track_deg == pytest.approx(turned_deg, abs=2.0)
    assert seen.lateral.min() < -0.1
    result = replay_log(flight.log)
    assert result.same, result.difference
    assert result.stated_sha256 == summary["history_sha256"]
