"""Properties that hold for any failure, command and time."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, STATE
from rtsim.aircraft.xv15.model import Xv15
from rtsim.faults import actuator_kernels as actuators
from rtsim.faults import fault_kernels as kernels
from rtsim.faults.actuator_kernels import PLANNED
from rtsim.faults.fault import ACTUATORS, Fault, fault_events
from rtsim.faults.schedule import fault_tables, new_fault_state
from rtsim.units import deg

AIRCRAFT = Xv15.load().tables
DT = 0.004
STILL = np.zeros(len(ALL_INPUTS))
times = st.floats(0.0, 100.0)
sticks = st.floats(-1.0, 1.0)
levers = st.floats(0.0, 1.0)
angles = st.floats(0.0, math.pi / 2.0)


@st.composite
def faults(draw):
    kind = draw(st.sampled_from(["stuck", "slow", "hard-over", "jam", "nacelle", "bias", "frozen", "engine"]))
    start = draw(times)
    end = draw(st.none() | st.floats(start + 0.1, start + 50.0))
    actuator = draw(st.sampled_from(ACTUATORS))
    rate = draw(st.floats(deg(0.1), deg(50.0)))
    fields = {
        "stuck": {"kind": "actuator-stuck", "actuator": actuator},
        "slow": {"kind": "actuator-slow", "actuator": actuator, "rate": rate},
        "hard-over": {"kind": "actuator-hard-over", "actuator": actuator, "rate": rate, "stop": "high"},
        "jam": {"kind": "nacelle-jammed"},
        "nacelle": {"kind": "nacelle-slow", "rate": rate},
        "bias": {"kind": "airspeed-bias", "bias": draw(st.floats(-20.0, 20.0))},
        "frozen": {"kind": "airspeed-frozen"},
        "engine": {"kind": "engine-limit", "power": draw(st.floats(0.0, 1e6))},
    }[kind]
    return Fault(start=start, end=end, **fields)


def aircraft_state(collective, cyclic, elevator):
    x = np.zeros(len(ALL_STATES))
    x[STATE.u] = 30.0
    x[[STATE.collective_75, STATE.cyclic_1s, STATE.elevator]] = collective, cyclic, elevator
    return x


@given(st.lists(faults(), max_size=6), st.lists(times, min_size=1, max_size=8))
def test_the_state_depends_on_the_schedule_not_on_how_often_it_is_asked(some, asked):
    """Updating at many times or once at the last gives the same flags; every event due has been taken."""
    tables = fault_tables(some)
    x, nacelle = aircraft_state(0.2, 0.0, 0.0), np.array([1.0, 1.0, 0.0])
    often, once = new_fault_state(), new_fault_state()
    for time in sorted(asked):
        kernels.fault_update(tables, often, time, x, STILL, nacelle, 3.0, 30.0)
    last = max(asked)
    kernels.fault_update(tables, once, last, x, STILL, nacelle, 3.0, 30.0)
    assert (often == once).all()
    assert once[kernels.FAULT.next] == sum(event.time <= last + 1e-9 for event in fault_events(some))


@given(st.lists(faults(), max_size=6), st.floats(-1.0, 1.0), st.floats(-30.0, 130.0))
def test_without_active_failures_everything_passes_untouched(some, rate, airspeed):
    tables, state = fault_tables(some), new_fault_state()
    x, nacelle = aircraft_state(0.2, 0.01, -0.02), np.array([1.0, 1.0, 0.1])
    kernels.fault_update(tables, state, -1.0, x, STILL, nacelle, 3.0, airspeed)
    planned = np.zeros(PLANNED.size)
    before = x.tobytes()
    actuators.fault_actuators_begin(tables, state, AIRCRAFT.controls, x, (0.5, 0.5), 1.0, (1e6, True), DT, planned)
    actuators.fault_actuators_end(tables, state, x, DT, planned)
    assert x.tobytes() == before
    assert kernels.fault_nacelle_rate(state, rate) == rate
    assert kernels.fault_airspeed_error(state, airspeed) == 0.0
    assert kernels.fault_mask(state) == 0
    assert nacelle.tobytes() == np.array([1.0, 1.0, 0.1]).tobytes()


@given(faults(), st.tuples(sticks, levers), angles, st.floats(-0.05, 0.8), st.floats(0.0, 4e6))
def test_a_failed_actuator_keeps_its_mean_and_stays_between_where_it_was_and_may_go(
    fault, commands, nacelle_angle, collective, power
):
    tables, state = fault_tables([fault]), new_fault_state()
    x = aircraft_state(collective, 0.05, -0.1)
    start = x.copy()
    kernels.fault_update(tables, state, fault.start, x, STILL, np.array([1.0, 1.0, 0.0]), 3.0, 30.0)
    planned = np.zeros(PLANNED.size)
    actuators.fault_actuators_begin(
        tables, state, AIRCRAFT.controls, x, commands, nacelle_angle, (power, True), DT, planned
    )
    if fault.leaves_symmetry:  # held apart below
        return
    for channel, position in enumerate((STATE.collective_75, STATE.cyclic_1s, STATE.elevator)):
        if math.isnan(planned[channel]):
            assert x[position] == start[position]
            continue
        assert math.isfinite(planned[channel])
        step = abs(planned[channel] - start[position])
        if fault.kind == "actuator-stuck":
            assert step == 0.0
        elif fault.rate is not None:
            assert step <= fault.rate * DT * (1.0 + 1e-9)


@given(faults(), st.tuples(sticks, levers), angles, st.lists(st.floats(-0.2, 0.2), min_size=4, max_size=4))
def test_what_fails_on_one_side_stands_still_or_keeps_its_rate_and_the_other_side_follows_its_command(
    fault, commands, nacelle_angle, differences
):
    tables, state = fault_tables([fault]), new_fault_state()
    x = aircraft_state(0.4, 0.05, -0.1)
    x[list(kernels.LATERAL)] = differences
    angle = lambda: [kernels.actuator_angle(x, channel) for channel in range(len(ACTUATORS))]  # noqa: E731
    start = angle()
    kernels.fault_update(tables, state, fault.start, x, STILL, np.array([1.0, 1.0, 0.0]), 3.0, 30.0)
    planned = np.zeros(PLANNED.size)
    for _ in range(3):  # nothing moves what the plant would: the lateral controls ask for what is there
        actuators.fault_actuators_begin(
            tables, state, AIRCRAFT.controls, x, commands, nacelle_angle, (0.0, False), DT, planned
        )
        actuators.fault_actuators_end(tables, state, x, DT, planned)
    assert np.isfinite(x).all()
    if not fault.leaves_symmetry:
        assert (x[list(kernels.LATERAL)] == differences).all()
        return
    failed = ACTUATORS.index(fault.actuator)
    if fault.kind == "actuator-stuck":
        assert math.isclose(angle()[failed], start[failed], abs_tol=1e-15)
    else:
        assert abs(angle()[failed] - start[failed]) <= 3.0 * fault.rate * DT * (1.0 + 1e-9) + 1e-15
