"""Failures: schedule, nacelle, actuators against a plant whose actuator really stands still, sensors, engine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES, INPUT, OUTPUT, STATE, whole
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError
from rtsim.faults import actuator_kernels as actuators
from rtsim.faults import fault_kernels as kernels
from rtsim.faults.actuator_kernels import PLANNED
from rtsim.faults.fault import Fault, FaultEvent, engine_rating, fault_events
from rtsim.faults.schedule import HARD_OVER_RATE, fault_tables, new_fault_state
from rtsim.nacelle.nacelle_kernels import nacelle_advance, new_actuator_state
from rtsim.nacelle.switch import load_nacelle_tables
from rtsim.units import HORSEPOWER, deg, kt

DT = 0.004
STILL = np.zeros(len(ALL_INPUTS))
POSITIONS = (STATE.collective_75, STATE.cyclic_1s, STATE.elevator)
NACELLE = load_nacelle_tables()


@pytest.fixture(scope="module")
def aircraft():
    return Xv15.load()


class Flight:
    """The nonlinear plant with failures around its step, stick and lever given as functions of time."""

    def __init__(self, aircraft, faults, *, airspeed, nacelle, tables=None):
        trim = aircraft.trim(Condition(airspeed=kt(airspeed), nacelle_angle=deg(nacelle)))
        assert trim.converged
        self.tables = aircraft.tables if tables is None else tables
        self.x, self.u = whole(trim.x, ALL_STATES), whole(trim.u, ALL_INPUTS)
        self.nacelle = deg(nacelle)
        self.faults, self.state = fault_tables(faults), new_fault_state()
        self.actuator = new_actuator_state(self.nacelle)
        self.work = np.zeros(nonlinear.WORK_COUNT + nonlinear.STEP_SIZE)
        self.path = np.array([[self.nacelle, 0.0, 0.0]] * 3)
        self.time = 0.0
        self.frame = 0
        self.governed = True

    @property
    def power(self):
        y, xdot = np.zeros(len(ALL_OUTPUTS)), np.zeros(len(ALL_STATES))
        nonlinear.outputs(self.tables, self.x, self.u, self.nacelle, y, xdot, self.work)
        return y[OUTPUT.power]

    def step(self, stick, lever):
        self.u[INPUT.stick], self.u[INPUT.lever] = stick, lever
        airspeed = self.x[STATE.u] * math.cos(self.x[STATE.pitch]) + self.x[STATE.w] * math.sin(self.x[STATE.pitch])
        kernels.fault_update(self.faults, self.state, self.frame * DT, self.x, self.u, self.actuator, 3.0, airspeed)
        planned = np.zeros(PLANNED.size)
        actuators.fault_actuators_begin(
            self.faults,
            self.state,
            self.tables.controls,
            self.x,
            (stick, lever),
            self.nacelle,
            (self.power, self.governed),
            DT,
            planned,
        )
        nonlinear.step(self.tables, self.x, self.u, self.path, DT, self.work)
        actuators.fault_actuators_end(self.faults, self.state, self.x, DT, planned)
        self.frame += 1
        return self.x.copy()

    def fly(self, seconds, stick, lever):
        start = self.u[INPUT.stick], self.u[INPUT.lever]
        times = DT * np.arange(round(seconds / DT))
        return np.array([self.step(start[0] + stick(t), start[1] + lever(t)) for t in times])


def wave(size, frequency):
    return lambda time: size * math.sin(frequency * time)


def frozen_actuator(aircraft, channel):
    """The aircraft with one actuator that cannot move: its lag is infinite."""
    rate = aircraft.tables.controls.actuator_rate.copy()
    rate[channel] = 0.0
    return aircraft.tables._replace(controls=aircraft.tables.controls._replace(actuator_rate=rate))


@pytest.mark.parametrize("channel", [0, 1, 2], ids=["collective", "cyclic", "elevator"])
def test_a_stuck_actuator_flies_like_one_that_cannot_move(aircraft, channel):
    name = ("collective", "cyclic", "elevator")[channel]
    fault = Fault(kind="actuator-stuck", actuator=name, start=0.0)
    stick, lever = wave(0.15, 2.0), wave(0.1, 1.5)
    failed = Flight(aircraft, [fault], airspeed=80.0, nacelle=75.0).fly(3.0, stick, lever)
    truth = Flight(aircraft, [], airspeed=80.0, nacelle=75.0, tables=frozen_actuator(aircraft, channel))
    expected = truth.fly(3.0, stick, lever)
    sound = Flight(aircraft, [], airspeed=80.0, nacelle=75.0).fly(3.0, stick, lever)
    assert (failed[:, POSITIONS[channel]] == failed[0, POSITIONS[channel]]).all()
    body = [STATE.u, STATE.w, STATE.q, STATE.pitch, STATE.altitude]
    difference = np.abs(failed - expected)[:, body].max(axis=0)
    effect = np.abs(failed - sound)[:, body].max(axis=0)
    assert (difference < 2e-3 * effect).all()
    flapping = [STATE.flap_1c, STATE.flap_1s]
    assert np.abs(failed - expected)[:, flapping].max() < deg(0.01)


@pytest.mark.parametrize(("name", "channel"), [("collective", 0), ("cyclic", 1), ("elevator", 2)])
def test_a_slow_actuator_never_exceeds_its_rate_and_catches_up(aircraft, name, channel):
    rate = deg(1.5)
    fault = Fault(kind="actuator-slow", actuator=name, start=0.0, rate=rate)
    flight = Flight(aircraft, [fault], airspeed=60.0, nacelle=82.5)
    step = lambda time: 0.3 if time < 0.5 else 0.0  # noqa: E731
    history = flight.fly(6.0, step, step)
    moved = np.diff(history[:, POSITIONS[channel]]) / DT
    assert np.abs(moved).max() == pytest.approx(rate, rel=1e-9)
    sound = Flight(aircraft, [], airspeed=60.0, nacelle=82.5).fly(6.0, step, step)
    assert history[-1, POSITIONS[channel]] == pytest.approx(sound[-1, POSITIONS[channel]], abs=deg(1e-3))
    others = [position for position in POSITIONS if position != POSITIONS[channel]]
    assert (history[:, others] == sound[:, others]).all()


@pytest.mark.parametrize(("stop", "sign"), [("low", -1.0), ("high", 1.0)])
def test_a_hard_over_runs_to_its_stop_at_its_rate(aircraft, stop, sign):
    fault = Fault(kind="actuator-hard-over", actuator="elevator", start=0.1, end=0.6, stop=stop)
    flight = Flight(aircraft, [fault], airspeed=100.0, nacelle=75.0)
    history = flight.fly(1.5, wave(0.0, 1.0), wave(0.0, 1.0))
    elevator = history[:, STATE.elevator]
    assert np.abs(np.diff(elevator))[: round(0.6 / DT) - 1].max() == pytest.approx(HARD_OVER_RATE * DT, rel=1e-9)
    trim = elevator[0]
    assert elevator[round(0.5 / DT)] == pytest.approx(trim + sign * HARD_OVER_RATE * (0.404), abs=1e-9)
    assert elevator[-1] == pytest.approx(trim, abs=deg(1e-3))  # mended: the lag brings it back
    slow = Fault(kind="actuator-hard-over", actuator="cyclic", start=0.0, stop=stop, rate=deg(60.0))
    history = Flight(aircraft, [slow], airspeed=0.0, nacelle=90.0).fly(0.4, wave(0.0, 1.0), wave(0.0, 1.0))
    assert history[-1, STATE.cyclic_1s] == pytest.approx(sign * aircraft.tables.controls.cyclic_limit)


def test_sound_actuators_are_not_touched(aircraft):
    """Bit for bit the plant's own step, and planned says so."""
    flight = Flight(aircraft, [], airspeed=60.0, nacelle=82.5)
    x, planned = flight.x.copy(), np.zeros(PLANNED.size)
    arguments = (aircraft.tables.controls, x, (0.3, 0.4), flight.nacelle, (1e6, True), DT, planned)
    actuators.fault_actuators_begin(flight.faults, flight.state, *arguments)
    assert np.isnan(planned[:3]).all()
    actuators.fault_actuators_end(flight.faults, flight.state, x, DT, planned)
    assert x.tobytes() == flight.x.tobytes()


def twin_step(aircraft, mode, value, rate, begin, command, stop, dt, actuator_rate):
    """The failed actuator in plain Python: end of the step, and the start that gives the mean."""
    gone = 1.0 - math.exp(-actuator_rate * dt)
    own = begin + gone * (command - begin)
    end = {
        "stuck": value,
        "slow": float(np.clip(own, begin - value * dt, begin + value * dt)),
        "hard-over": begin + float(np.clip(stop - begin, -rate * dt, rate * dt)),
    }[mode]
    # start s with (s + s + gone (command - s)) / 2 = (begin + end) / 2
    return end, (begin + end - gone * command) / (2.0 - gone)


@pytest.mark.parametrize("mode", ["stuck", "slow", "hard-over"])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_begin_is_its_plain_twin(aircraft, mode, channel):
    name = ("collective", "cyclic", "elevator")[channel]
    fields = {"stuck": {}, "slow": {"rate": deg(2.0)}, "hard-over": {"stop": "low", "rate": deg(7.0)}}[mode]
    fault = Fault(kind=f"actuator-{mode}", actuator=name, start=0.0, **fields)
    flight = Flight(aircraft, [fault], airspeed=60.0, nacelle=82.5)
    begin = flight.x[POSITIONS[channel]]
    kernels.fault_update(flight.faults, flight.state, 0.0, flight.x, flight.u, flight.actuator, 3.0, 30.0)
    planned = np.zeros(PLANNED.size)
    controls = aircraft.tables.controls
    commands = nonlinear.commanded_controls(controls, -0.4, 0.8, flight.nacelle)
    low = nonlinear.commanded_controls(controls, 0.0, 0.0, flight.nacelle)[0]
    stops = (low, -controls.cyclic_limit, -controls.elevator_limit)
    actuators.fault_actuators_begin(
        flight.faults, flight.state, controls, flight.x, (-0.4, 0.8), flight.nacelle, (1e6, True), DT, planned
    )
    value = begin if mode == "stuck" else deg(2.0)
    end, start = twin_step(
        aircraft, mode, value, deg(7.0), begin, commands[channel], stops[channel], DT, controls.actuator_rate[channel]
    )
    assert planned[channel] == pytest.approx(end, rel=1e-12)
    assert flight.x[POSITIONS[channel]] == pytest.approx(start, rel=1e-9)
    assert np.isnan(np.delete(planned[:3], channel)).all()


def test_a_jam_stops_the_nacelles_within_a_second_and_without_turning_back():
    fault = Fault(kind="nacelle-jammed", start=1.0, end=3.0)
    tables, state = fault_tables([fault]), new_fault_state()
    nacelle = new_actuator_state(deg(80.0))
    x = np.zeros(len(ALL_STATES))
    angles, rates, ok = [], [], []
    for k in range(1250):
        kernels.fault_update(tables, state, k * DT, x, STILL, nacelle, NACELLE.frequency, 0.0)
        nacelle_advance(NACELLE, nacelle, kernels.fault_nacelle_rate(state, deg(-3.0)), DT)
        angles.append(nacelle[1])
        rates.append(nacelle[2])
        ok.append(kernels.fault_nacelle_ok(state))
    angles = np.array(angles)
    jam, mend = 250, 750
    # The actuator runs out over 1 / 3 s: 3 deg/s leave one degree, less than a command that just stops.
    at_jam, rate = angles[jam - 1], rates[jam - 1]
    assert rate == pytest.approx(deg(-3.0), rel=0.25)
    time = DT * np.arange(1, mend - jam + 1)
    assert angles[jam:mend] == pytest.approx(at_jam + rate / 3.0 * (1.0 - np.exp(-3.0 * time)), abs=1e-12)
    assert (np.diff(angles) <= 0.0).all()
    assert angles[mend - 1] - angles[jam + 250] == pytest.approx(0.0, abs=deg(0.06))
    assert ok == [not jam <= k < mend for k in range(1250)]
    assert (angles[-1] - angles[-2]) / DT == pytest.approx(deg(-3.0), rel=0.05)


def test_slow_nacelles_keep_the_sign_and_small_rates():
    state = new_fault_state()
    assert kernels.fault_nacelle_rate(state, deg(-12.0)) == deg(-12.0)
    tables = fault_tables([Fault(kind="nacelle-slow", start=0.0, rate=deg(1.0))])
    kernels.fault_update(tables, state, 0.0, np.zeros(len(ALL_STATES)), STILL, np.zeros(3), 3.0, 0.0)
    rates = [kernels.fault_nacelle_rate(state, deg(rate)) for rate in (-12.0, -0.5, 0.0, 0.5, 12.0)]
    assert rates == pytest.approx([deg(rate) for rate in (-1.0, -0.5, 0.0, 0.5, 1.0)])
    assert kernels.fault_nacelle_ok(state)


def test_the_airspeed_indication_is_biased_or_stands_still():
    faults = [
        Fault(kind="airspeed-bias", start=1.0, end=4.0, bias=kt(10.0)),
        Fault(kind="airspeed-frozen", start=2.0, end=3.0),
    ]
    tables, state = fault_tables(faults), new_fault_state()
    x, nacelle = np.zeros(len(ALL_STATES)), np.zeros(3)
    shown = []
    for second in range(6):
        true = 40.0 + second
        kernels.fault_update(tables, state, float(second), x, STILL, nacelle, 3.0, true)
        shown.append(true + kernels.fault_airspeed_error(state, true))
    bias = kt(10.0)
    assert shown == pytest.approx([40.0, 41.0 + bias, 42.0 + bias, 43.0 + bias, 44.0, 45.0])


def test_the_power_of_one_engine_is_not_exceeded(aircraft):
    """In hover at 13 000 lb one engine at contingency rating does not suffice: the aircraft settles, torque held."""
    fault = Fault(kind="engine-limit", start=0.5, power=0.0)
    available = 0.93 * 1802.0 * HORSEPOWER
    flight = Flight(aircraft, [fault], airspeed=0.0, nacelle=90.0)
    assert flight.power > 1.05 * available
    powers = []
    start = flight.u[INPUT.stick], flight.u[INPUT.lever]
    for k in range(round(3.0 / DT)):
        flight.step(start[0], start[1] + (0.1 if k * DT > 2.0 else 0.0))  # pulling does not help
        powers.append(flight.power)
    powers = np.array(powers)
    assert powers[: round(0.5 / DT)] == pytest.approx(powers[0], rel=1e-3)
    assert (powers[round(2.0 / DT) :] < available * 1.005).all()
    assert (powers[round(2.0 / DT) :] > available * 0.97).all()
    assert flight.x[STATE.altitude] < -1.0


def test_without_the_governor_nothing_takes_the_collective_back(aircraft):
    """The governor is what lowers the blades where the power is short; switched off, the pilot has the collective."""
    flight = Flight(aircraft, [Fault(kind="engine-limit", start=0.0, power=0.0)], airspeed=0.0, nacelle=90.0)
    flight.governed = False
    start = flight.x[STATE.collective_75]
    for _ in range(250):
        flight.step(flight.u[INPUT.stick], flight.u[INPUT.lever])
    assert flight.x[STATE.collective_75] == pytest.approx(start, abs=1e-9)


def test_power_enough_is_no_failure(aircraft):
    power = engine_rating(xv15_profile(), "takeoff")
    fault = Fault(kind="engine-limit", start=0.0, power=power, other_engine="takeoff")
    stick, lever = wave(0.05, 2.0), wave(0.02, 2.0)
    limited = Flight(aircraft, [fault], airspeed=80.0, nacelle=75.0).fly(1.0, stick, lever)
    sound = Flight(aircraft, [], airspeed=80.0, nacelle=75.0).fly(1.0, stick, lever)
    assert limited.tobytes() == sound.tobytes()


def test_the_governor_approaches_the_limit_from_below_as_one_exponential(aircraft):
    """Its rule in plain Python: collective rises no faster than frequency * power left / power per collective."""
    flight = Flight(aircraft, [Fault(kind="engine-limit", start=0.0, power=0.0)], airspeed=150.0, nacelle=20.0)
    kernels.fault_update(flight.faults, flight.state, 0.0, flight.x, flight.u, flight.actuator, 3.0, 0.0)
    along = flight.x[STATE.u] * math.cos(flight.nacelle) - flight.x[STATE.w] * math.sin(flight.nacelle)
    slope = (160.0 + 5.0 * along / kt(1.0)) * HORSEPOWER / deg(1.0)
    for power in (0.0, 1e6, 2e6):
        limit = actuators.collective_rate_limit(flight.faults, flight.state, flight.x, flight.nacelle, power)
        assert limit == pytest.approx(3.0 * (0.93 * 1802.0 * HORSEPOWER - power) / slope)


def test_the_schedule_is_what_the_event_log_says():
    faults = [
        Fault(kind="actuator-stuck", actuator="cyclic", start=5.0, end=6.0),
        Fault(kind="nacelle-jammed", start=2.0),
        Fault(kind="actuator-slow", actuator="cyclic", start=6.0, rate=deg(2.0)),
    ]
    assert fault_events(faults) == (
        FaultEvent(2.0, "nacelle-jammed on", 0.0),
        FaultEvent(5.0, "cyclic-stuck on", 0.0),
        FaultEvent(6.0, "cyclic-stuck off", 0.0),
        FaultEvent(6.0, "cyclic-slow on", deg(2.0)),
    )
    schedule = fault_tables(faults).schedule
    assert schedule.shape == (4, kernels.EVENT.size)
    assert not schedule.flags.writeable
    assert fault_tables([]).schedule.shape == (0, kernels.EVENT.size)


def test_the_mask_names_every_failure():
    x, nacelle = np.zeros(len(ALL_STATES)), np.zeros(3)
    kinds = [
        ({"kind": "nacelle-jammed"}, kernels.MASK_JAMMED),
        ({"kind": "nacelle-slow", "rate": 0.1}, kernels.MASK_NACELLE_SLOW),
        ({"kind": "actuator-stuck", "actuator": "collective"}, kernels.MASK_COLLECTIVE),
        ({"kind": "actuator-slow", "actuator": "cyclic", "rate": 0.1}, kernels.MASK_CYCLIC),
        ({"kind": "actuator-hard-over", "actuator": "elevator", "stop": "low"}, kernels.MASK_ELEVATOR),
        ({"kind": "airspeed-bias", "bias": 3.0}, kernels.MASK_AIRSPEED),
        ({"kind": "airspeed-frozen"}, kernels.MASK_AIRSPEED),
        ({"kind": "engine-limit", "power": 0.0}, kernels.MASK_ENGINE),
    ]
    for fields, mask in kinds:
        state = new_fault_state()
        tables = fault_tables([Fault(start=1.0, end=2.0, **fields)])
        masks = []
        for time in (0.0, 1.0, 2.0):
            kernels.fault_update(tables, state, time, x, STILL, nacelle, 3.0, 0.0)
            masks.append(kernels.fault_mask(state))
        assert masks == [0, mask, 0], fields


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "gearbox"}, "kind: is not known"),
        ({"kind": "nacelle-jammed", "start": -1.0}, "start: is out of range"),
        ({"kind": "nacelle-jammed", "end": 0.5}, "end: is not after start"),
        ({"kind": "nacelle-jammed", "rate": 0.1}, "rate: has no meaning for nacelle-jammed"),
        ({"kind": "nacelle-slow"}, "rate: is missing for nacelle-slow"),
        ({"kind": "nacelle-slow", "rate": -0.1}, "rate: is out of range"),
        ({"kind": "actuator-stuck"}, "actuator: is missing"),
        ({"kind": "actuator-stuck", "actuator": "throttle"}, "collective, cyclic, elevator, collective-right"),
        ({"kind": "actuator-hard-over", "actuator": "cyclic"}, "stop: is missing"),
        ({"kind": "actuator-hard-over", "actuator": "cyclic", "stop": "up"}, "stop: is not known"),
        ({"kind": "actuator-hard-over", "actuator": "cyclic", "stop": "low", "rate": 0.0}, "rate: is out of range"),
        ({"kind": "airspeed-bias", "bias": math.nan}, "bias: is out of range"),
        ({"kind": "engine-limit"}, "power: is missing"),
        ({"kind": "engine-limit", "power": 2e7}, "power: is out of range"),
        ({"kind": "engine-limit", "power": 0.0, "other_engine": "war"}, "other_engine: is not known"),
    ],
)
def test_mistakes_in_failures(fields, words):
    with pytest.raises(InputError, match=words):
        Fault(**{"start": 1.0, **fields})


def test_the_governor_knows_the_power_of_the_collective_within_a_factor_of_two():
    """The fitted slope against the database at every trim of the level layer."""
    from rtsim.lpv.aircraft import load_aircraft

    database = load_aircraft().database
    level = database.level_layer
    valid = database.valid[level]
    rotor_speed = Xv15.load().tables.configuration.rotor_speed
    slope = (2.0 * rotor_speed * database.C[level][..., OUTPUT.torque, STATE.collective_75])[valid]
    x = database.x_ref[level]
    angle = np.broadcast_to(database.nacelle, valid.shape)
    along = (x[..., STATE.u] * np.cos(angle) - x[..., STATE.w] * np.sin(angle))[valid]
    tables = fault_tables([])
    fitted = tables.power_per_collective + tables.power_per_collective_speed * np.maximum(along, 0.0)
    assert (slope / fitted).min() > 0.5
    assert (slope / fitted).max() < 2.0
