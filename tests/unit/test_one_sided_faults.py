"""Failures out of the plane of symmetry: against finer steps, against the mirror, against both sides, and refused."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import ALL_INPUTS, ALL_STATES, INPUT, STATE, STATES, whole
from rtsim.aircraft.xv15 import dynamics_kernels as nonlinear
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError
from rtsim.faults import actuator_kernels as actuators
from rtsim.faults import fault_kernels as kernels
from rtsim.faults.fault import ACTUATORS, Fault, check_sides
from rtsim.faults.schedule import fault_tables, new_fault_state
from rtsim.units import deg, kt

BODY = [STATE.u, STATE.v, STATE.w, STATE.p, STATE.q, STATE.r, STATE.pitch, STATE.bank, STATE.heading]
AIRCRAFT = Xv15.load()


def fly(faults, *, dt=0.004, side=1.0, seconds=1.2):
    """The nonlinear aircraft with waves of all four controls at 60 kn and nacelle 75; ``side`` -1: mirrored."""
    trim = AIRCRAFT.trim(Condition(airspeed=kt(60), nacelle_angle=deg(75)))
    x, u = whole(trim.x, ALL_STATES), whole(trim.u, ALL_INPUTS)
    stick, lever = u[INPUT.stick], u[INPUT.lever]
    tables, state, planned = fault_tables(faults), new_fault_state(), np.zeros(actuators.PLANNED.size)
    work = np.zeros(nonlinear.WORK_COUNT + nonlinear.STEP_SIZE)
    angle = deg(75)
    path, history = np.array([[angle, 0.0, 0.0]] * 3), []
    controls = AIRCRAFT.tables.controls
    for k in range(round(seconds / dt)):
        time = (k // round(0.004 / dt)) * 0.004  # hands move with the frames of the coarser flight
        u[INPUT.stick], u[INPUT.lever] = stick + 0.1 * np.sin(2 * time), lever + 0.1 * np.sin(1.5 * time)
        u[INPUT.lateral_stick], u[INPUT.pedal] = side * 0.2 * np.sin(2.5 * time), side * 0.3 * np.sin(1.8 * time)
        kernels.fault_update(tables, state, k * dt, x, u, np.array([angle, angle, 0.0]), 3.0, 30.0)
        actuators.fault_actuators_begin(
            tables, state, controls, x, (u[INPUT.stick], u[INPUT.lever]), angle, (0.0, False), dt, planned
        )
        nonlinear.step(AIRCRAFT.tables, x, u, path, dt, work)
        actuators.fault_actuators_end(tables, state, x, dt, planned)
        history.append(x.copy())
    return np.array(history)


def stuck(actuator):
    return Fault(kind="actuator-stuck", actuator=actuator, start=0.2)


@pytest.mark.parametrize("actuator", ["collective-right", "cyclic-left", "aileron", "rudder"])
def test_a_failure_converges_with_the_step_and_stands_still(actuator):
    """A quarter of the frame leaves a quarter of the ripple: both agree to 1 % of what the failure does."""
    coarse, fine, sound = fly([stuck(actuator)]), fly([stuck(actuator)], dt=0.001), fly([])
    fine = fine[3::4]
    effect = np.abs(coarse - sound)[:, BODY].max(axis=0)
    assert effect[BODY.index(STATE.bank)] + effect[BODY.index(STATE.heading)] > deg(0.1)
    assert (np.abs(coarse - fine)[:, BODY].max(axis=0) < 0.01 * effect).all()
    angles = [kernels.actuator_angle(x, ACTUATORS.index(actuator)) for x in coarse]
    assert np.ptp(angles[50:]) < 1e-12


def test_the_mirrored_failure_flies_the_mirrored_flight_to_the_last_bit():
    right, left = fly([stuck("collective-right")]), fly([stuck("collective-left")], side=-1.0)
    sign = np.ones(len(ALL_STATES))
    sign[len(STATES) : -2] = -1.0
    flown = slice(0, len(ALL_STATES) - 2)  # the place is not moved by the plant alone
    assert (right[:, flown] == (sign * left)[:, flown]).all()


def test_both_sides_stuck_are_the_actuator_of_both_stuck_with_the_lateral_controls_still():
    """Two failures of a side against the one of both: half difference and mean of two angles that stand still."""
    sides = [stuck("cyclic-right"), stuck("cyclic-left")]
    apart = fly(sides)
    assert np.ptp(apart[50:, STATE.cyclic_1s]) < 1e-12
    assert np.ptp(apart[50:, STATE.cyclic_difference]) < 1e-12
    together = fly([stuck("cyclic")])
    assert np.abs(apart - together)[:, STATE.cyclic_1s].max() < 1e-12


def test_a_slow_and_a_runaway_side_keep_their_rates_and_the_other_side_is_sound():
    rate = deg(3.0)
    for fault in (
        Fault(kind="actuator-slow", actuator="collective-left", start=0.0, rate=rate),
        Fault(kind="actuator-hard-over", actuator="collective-left", start=0.0, stop="high", rate=rate),
    ):
        flight = fly([fault], seconds=0.8)
        left = flight[:, STATE.collective_75] - flight[:, STATE.collective_difference]
        right = flight[:, STATE.collective_75] + flight[:, STATE.collective_difference]
        assert np.abs(np.diff(left)).max() <= rate * 0.004 * (1 + 1e-9)
        sound = fly([], seconds=0.8)
        expected = sound[:, STATE.collective_75] + sound[:, STATE.collective_difference]
        assert np.abs(right - expected).max() < deg(0.002)


def test_one_side_is_refused_where_an_aircraft_has_but_one_half():
    check_sides(stuck("cyclic-right"), rolls=True)
    check_sides(stuck("cyclic"), rolls=False)
    check_sides(Fault(kind="control-jammed", control="stick", start=0.0), rolls=False)
    for fault in (stuck("rudder"), Fault(kind="control-jammed", control="pedal", start=0.0)):
        with pytest.raises(InputError, match="plane of symmetry alone"):
            check_sides(fault, rolls=False)


def test_a_failure_has_its_own_fields_and_name():
    assert Fault(kind="control-jammed", control="lateral-stick", start=0.0).name == "lateral-stick-jammed"
    assert stuck("collective-right").name == "collective-right-stuck"
    with pytest.raises(InputError, match="is missing"):
        Fault(kind="control-jammed", start=0.0)
    with pytest.raises(InputError, match="no meaning"):
        Fault(kind="actuator-stuck", actuator="rudder", control="pedal", start=0.0)
    with pytest.raises(InputError, match="is not known"):
        Fault(kind="control-jammed", control="pedals", start=0.0)


def test_the_lag_and_the_stops_are_those_of_the_nonlinear_model():
    tables, lateral = fault_tables([]), AIRCRAFT.tables.lateral.controls
    assert tables.difference_rate == pytest.approx(lateral.actuator_rate)
    assert tables.rudder_stop == pytest.approx(lateral.rudder_per_pedal)
    assert tables.aileron_stop == pytest.approx(lateral.aileron_per_stick, rel=0.01)
