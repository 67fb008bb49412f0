"""The law ``full`` out of the plane of symmetry: bank, sideslip, one mast's torque, one side that does not answer."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.command import SENSOR
from rtsim.corridor.boundaries import load_corridor
from rtsim.loop.data import CHANNEL
from rtsim.lpv.aircraft import load_aircraft
from rtsim.lpv.files.storage import load_database
from rtsim.protection import law_data as data
from rtsim.protection import law_kernels as kernels
from rtsim.protection import sideways_limiter_kernels as sideways
from rtsim.protection.limits import load_limits
from rtsim.protection.tables import law_tables
from rtsim.units import INCH_POUND, deg, kt

DT = 0.004
TABLES = {name: law_tables(name, load_database(), dt=DT) for name in ("governor", "full")}
MIRRORED = (
    "bank", "roll_rate", "yaw_rate", "sideslip", "lateral_velocity", "lateral_acceleration", "east",
)  # fmt: skip
SIDES = (("flapping_left", "flapping_right"), ("mast_torque_left", "mast_torque_right"))
SMALL = st.floats(-1.0, 1.0)


class Bench:
    """The law facing sensors that the test sets, about a trim at 125 kn, nacelles at 30 deg."""

    def __init__(self, law="full", airspeed_kt=125.0, nacelle_deg=30.0):
        point = load_aircraft().trim(airspeed=kt(airspeed_kt), nacelle=deg(nacelle_deg))
        self.tables, self.state, self.work = TABLES[law], np.zeros(data.LAW.size), np.zeros(data.WORK_SIZE)
        kernels.law_start(self.tables, self.state)
        self.trim = np.array([point.u[0], point.u[1], 0.0, 0.0, 0.0])
        self.sensors = np.zeros(SENSOR.size)
        self.frame = 0
        flapping = np.hypot(point.x[7], point.x[9])
        self.see(
            airspeed=kt(airspeed_kt), nacelle_angle=deg(nacelle_deg), pitch=point.x[3], altitude=300.0, load_factor=1.0,
            mast_torque=point.y[1], mast_torque_left=point.y[1], mast_torque_right=point.y[1], flapping=flapping,
            flapping_left=flapping, flapping_right=flapping, nacelle_ok=1.0,
        )  # fmt: skip

    def see(self, **values):
        for name, value in values.items():
            self.sensors[getattr(SENSOR, name)] = value
        return self

    def step(self, lateral=0.0, pedal=0.0, lever=0.0, frames=5):
        command, applied = self.trim + np.array([0.0, lever, 0.0, lateral, pedal]), np.zeros(CHANNEL.size)
        for _ in range(frames):
            kernels.protect(self.tables, self.state, self.frame, self.sensors, command, applied, self.work)
            self.frame += 1
        return applied - self.trim


@given(st.floats(-0.9, 0.9), SMALL, SMALL, st.floats(-0.2, 0.2), SMALL, SMALL, SMALL)
def test_a_mirrored_flight_is_limited_in_the_mirror(bank, p, r, slip, lateral, pedal, twist):
    """Mirror symmetry: odd sensors and lateral channels change their sign, sides change places; exact to rounding."""
    found = []
    for sign in (1.0, -1.0):
        bench = Bench()
        torque = bench.sensors[SENSOR.mast_torque]
        right, left = torque * (1.0 + 0.5 * twist), torque * (1.0 - 0.5 * twist)
        if sign < 0.0:
            right, left = left, right
        bench.see(bank=sign * bank, roll_rate=sign * p, yaw_rate=sign * r, sideslip=sign * slip)
        bench.see(mast_torque_right=right, mast_torque_left=left)
        found.append(bench.step(sign * lateral, sign * pedal, frames=60))
    np.testing.assert_allclose(found[0][:3], found[1][:3], atol=1e-12)
    np.testing.assert_allclose(found[0][3:], -found[1][3:], atol=1e-12)


def test_what_needs_no_limit_passes_bit_for_bit():
    bench = Bench().see(bank=deg(20.0), yaw_rate=0.05, roll_rate=0.02, sideslip=0.01)
    applied = np.zeros(CHANNEL.size)
    for k in range(60):
        command = bench.trim + np.array([0.0, 0.0, 0.0, 0.1 * np.sin(k), 0.1 * np.cos(k)])
        kernels.protect(bench.tables, bench.state, k, bench.sensors, command, applied, bench.work)
        assert applied[CHANNEL.lateral_stick :].tolist() == command[CHANNEL.lateral_stick :].tolist()
    assert bench.state[data.LAW.lateral_cause] == bench.state[data.LAW.pedal_cause] == data.REASON_NONE


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_bank_beyond_what_is_allowed_is_rolled_back(side):
    bench = Bench(nacelle_deg=10.0).see(bank=side * deg(50.0))
    assert side * bench.step(side * 0.8)[3] < 0.0
    assert bench.state[data.LAW.lateral_cause] in {data.REASON_BANK, data.REASON_LOW}
    assert side * bench.step(-side * 1.0)[3] == -1.0, "whoever rolls out faster is let"


def test_the_bank_left_shrinks_with_the_margin_and_never_below_what_is_always_left():
    low = load_corridor("flight").low_speed(deg(30.0))
    left = []
    for margin in (1.0, 4.0, 8.0, 12.0, 18.0, 30.0):
        bench = Bench().see(airspeed=low + kt(margin))
        left.append(sideways.turn_allowed(bench.tables, bench.sensors)[0])
    settings = TABLES["full"].settings
    assert left[0] == settings.bank_least
    assert all(later >= earlier for earlier, later in itertools.pairwise(left))
    assert left[-1] == load_limits().sideways.bank - settings.bank_buffer
    slowing = Bench().see(airspeed=low + kt(12.0), airspeed_rate=-kt(4.0))
    assert sideways.turn_allowed(slowing.tables, slowing.sensors)[0] < left[3]


def test_governor_leaves_stick_and_pedals_alone():
    bench = Bench("governor").see(bank=deg(60.0), roll_rate=1.0, sideslip=0.4)
    assert bench.step(0.9, -0.8)[3:].tolist() == [0.9, -0.8]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_pedals_that_would_pass_the_sideslip_are_held(side):
    """Wind from the right grows with the nose going left: the left pedal is held, the right one passes."""
    limit = load_limits().sideways.fast
    bench = Bench().see(sideslip=side * np.arctan(0.95 * limit / kt(125.0)))
    assert side * bench.step(pedal=-side * 1.0)[4] > -0.9
    assert bench.state[data.LAW.pedal_cause] == data.REASON_SIDESLIP
    assert bench.step(pedal=side * 0.9)[4] == side * 0.9


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_lateral_stick_leaves_room_to_the_mast_that_carries_more(side):
    """Left stick raises the right collective: with the right mast near its limit it is bounded, right stick is not."""
    bench = Bench()
    near = 0.95 * 130_000.0 * INCH_POUND
    bench.see(**{f"mast_torque_{'right' if side > 0.0 else 'left'}": near})
    assert side * bench.step(-side * 0.8)[3] > -0.5
    assert bench.state[data.LAW.lateral_cause] == data.REASON_TORQUE
    assert Bench().see(mast_torque_right=near).step(0.5)[3] == 0.5


def test_the_worse_rotor_counts():
    """A mast or a rotor of one side over its limit acts on lever and stick as both would."""
    bench = Bench()
    bench.see(mast_torque_left=1.2 * 130_000.0 * INCH_POUND)
    assert bench.step(lever=0.1, frames=100)[1] < 0.0
    assert sideways.worst_flapping(Bench().see(flapping_left=0.2).sensors) == 0.2


def test_the_lever_stays_where_both_sides_answered():
    """One collective stuck: rolling that the model does not know of. The lever is held near where there was none, and a
    mast beyond its limit takes it no further down."""
    bench = Bench().see(bank=0.01)
    bench.step(frames=50)
    even = bench.state[data.LAW.even_lever]
    for k in range(100):
        bench.see(roll_rate=0.02 * k).step(lever=0.0 if k < 50 else -0.3)
    room = bench.tables.settings.uneven_lever
    assert bench.state[data.LAW.lever_low] == pytest.approx(even - room)
    bench.see(mast_torque_left=1.3 * 130_000.0 * INCH_POUND)
    assert bench.step(lever=-0.3, frames=50)[1] >= -room - 1e-9 + even - bench.trim[1]


def test_an_aircraft_without_such_limits_is_not_limited():
    """Own data need not name bank and sideslip: they are then infinite, and nobody is told of them."""
    free = load_limits().sideways._replace(bank=np.inf, bank_helicopter=np.inf, slow=np.inf, fast=np.inf)
    assert sideways.bank_limit(free, deg(85.0)) == np.inf
    assert sideways.sideward_limit(free, kt(80.0)) == np.inf
    bench = Bench(airspeed_kt=150.0).see(bank=deg(50.0), sideslip=0.3)
    bench.tables = bench.tables._replace(sideways=free)
    assert bench.step(0.3, 0.4)[4] == 0.4
    assert bench.state[data.LAW.lateral_cause] in {data.REASON_NONE, data.REASON_LOW, data.REASON_HIGH}


def test_limits_are_those_of_the_data():
    limits = load_limits().sideways
    angles = [(0.0, 45.0), (75.0, 45.0), (82.5, 40.0), (90.0, 35.0)]
    for angle, bank in angles:
        assert sideways.bank_limit(limits, deg(angle)) == pytest.approx(deg(bank))
    for airspeed, sideward in ((0.0, 30.0), (60.0, 30.0), (80.0, 25.5), (100.0, 21.0), (180.0, 21.0)):
        assert sideways.sideward_limit(limits, kt(airspeed)) == pytest.approx(kt(sideward))
