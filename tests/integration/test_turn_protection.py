"""Protection where the aircraft banks: whole flights in turns, by sideslip and with one side failed, and campaigns."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.frame import COLUMN
from rtsim.loop.setup import FlightSetup
from rtsim.programme import TURN, Programme
from rtsim.protection.limits import LIMIT_KINDS
from rtsim.units import deg, kt
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.events import EVENTS
from scenarios.campaign.spec import load_campaign, parse_campaign
from scenarios.campaign.trial import Bench, FlightPlan

SPEC, _ = load_campaign("turns")
CLASSES = [item.name for item in SPEC.classes]
LEAVE = {"pedals": "sideslip", "runaway": ""}
"""What unprotected flights of a class violate, where it is not the corridor; of a runaway, not every one."""


@pytest.mark.parametrize("name", CLASSES)
def test_full_keeps_the_corridor_where_unprotected_flights_leave_it(name):
    """The campaign's classes, two flights each: none outside, none harmed, and not vacuous."""
    number, needed, left = CLASSES.index(name), LEAVE.get(name, "corridor"), False
    for run in range(2):
        plan = draw_plan(SPEC, seed=3, class_number=number, run=run)
        off, full = (Bench().fly(plan, law).metrics for law in ("off", "full"))
        left |= needed in off.exceeded
        assert not {"corridor", "control"} & full.exceeded, (run, full.exceeded)
        assert not EVENTS["harmed"](full.numbers[None, :], off.numbers[None, :])[0]
    assert left or not needed


def steep_turn(side: float) -> FlightPlan:
    points = np.array([0.0, 1.0, 3.0, 12.0])
    same = np.ones(4)
    programme = Programme(
        points, kt(120.0) * same, deg(25.0) * same, 300.0 * same, TURN.bank * same,
        side * deg(55.0) * np.array([0.0, 0.0, 1.0, 1.0]),
    )  # fmt: skip
    return FlightPlan(FlightSetup(programme=programme), 12.0)


def test_a_protected_turn_to_the_left_is_the_mirror_image_of_one_to_the_right():
    """Mirror symmetry with the law acting, to the last bit: the limits know no side."""
    right, left = (Bench().fly(steep_turn(side), "full", keep=True).rows for side in (1.0, -1.0))
    for signal, sign in (
        ("bank_deg", -1.0), ("lateral_stick", -1.0), ("pedal", -1.0), ("protection_lateral_stick", -1.0),
        ("airspeed_kt", 1.0), ("margin_kt", 1.0), ("stick", 1.0), ("lever", 1.0), ("time_to_limit_s", 1.0),
        ("protection_lateral_stick_reason", 1.0),
    ):  # fmt: skip
        column = getattr(COLUMN, signal)
        np.testing.assert_allclose(right[:, column], sign * left[:, column], rtol=0.0, atol=1e-9, err_msg=signal)
    assert right[:, COLUMN.protection_lateral_stick_reason].any()


def test_the_margins_of_a_turn_are_those_of_its_load_factor_and_reasons_have_names():
    flight = Bench().fly(steep_turn(1.0), "monitor", keep=True)
    banked = np.abs(flight.rows[:, COLUMN.bank_deg]) > 30.0
    straight = flight.rows[0, COLUMN.margin_low_kt]
    assert banked.any()
    lost = straight - flight.rows[banked, COLUMN.margin_low_kt]
    assert lost.min() > 4.0, "at 30 deg of bank the low-speed side is up by 4 kn and more"
    ahead = flight.rows[:, COLUMN.time_to_limit_s]
    crossing = np.flatnonzero(flight.rows[:, COLUMN.margin_kt] < 0.0)[0]
    assert ahead[:crossing].min() < 1.5, "and the crossing is predicted"
    protected = Bench().fly(steep_turn(1.0), "full", keep=True).rows
    reasons = set(protected[:, COLUMN.protection_lateral_stick_reason]) - {0.0}
    names = {LIMIT_KINDS[int(reason) - 1] for reason in reasons}
    assert names <= {"stall_attitude", "load_torque", "bank_attitude", "mast_torque", "sideslip"}


def test_the_governor_keeps_a_conversion_in_a_turn():
    """The nacelles alone: the switch held forward in a turn stops at the side of the turn, not of straight flight."""
    number = CLASSES.index("turning_conversion")
    plan = draw_plan(SPEC, seed=5, class_number=number, run=1)
    straight = dataclasses.replace(plan.setup.programme, turn=np.zeros(plan.setup.programme.time.size))
    level = FlightPlan(dataclasses.replace(plan.setup, programme=straight), plan.duration)
    turning, ahead = (Bench().fly(one, "governor", keep=True) for one in (plan, level))
    assert "corridor" not in turning.metrics.exceeded
    assert turning.rows[:, COLUMN.nacelle_deg].min() >= ahead.rows[:, COLUMN.nacelle_deg].min() - 0.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("turn = { begin_s = 1 }", "needs either bank_deg or turn_rate_deg_s"),
        ("turn = { bank_deg = { uniform = [0, 80] } }", "out of range"),
        ('faults = [{ kind = "actuator-stuck", time_s = 1 }]', "missing for actuator-stuck"),
        ('faults = [{ kind = "nacelle-jammed", time_s = 1, actuator = "aileron" }]', "has no meaning"),
        ('faults = [{ kind = "control-jammed", time_s = 1, control = ["pedal", "wheel"] }]', "wheel"),
    ],
)
def test_what_a_class_says_wrongly_of_turns_and_failures_is_named(text, message):
    head = 'format = 1\nname = "a"\ntitle = "a"\n[[classes]]\nname = "b"\n'
    head += "start = { airspeed_kt = 120, nacelle_deg = 30 }\n"
    spec, problems = parse_campaign(head + text + "\n", file="a.toml")
    assert spec is None
    assert message in str(problems[0])


def test_drawn_failures_and_turns_repeat_and_differ():
    number = CLASSES.index("one_side_failed")
    plans = [draw_plan(SPEC, seed=1, class_number=number, run=run) for run in range(12)]
    again = draw_plan(SPEC, seed=1, class_number=number, run=5)
    assert again.setup.faults == plans[5].setup.faults
    assert np.array_equal(again.setup.programme.turn, plans[5].setup.programme.turn)
    assert len({plan.setup.faults[0].actuator for plan in plans}) >= 3
    banks = np.array([plan.setup.programme.turn[-1] for plan in plans])
    assert (banks > 0.0).any()
    assert (banks < 0.0).any()
    assert np.abs(banks).max() <= deg(30.0)
