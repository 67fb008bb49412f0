"""Properties: what may be written, what it means, how it is refused.

Sources: robustness of signal temporal logic after Donzé and Maler, "Robust satisfaction of temporal logic over
real-valued signals" (2010); rtamt's own discrete-time monitor as an independent evaluation of the same formulas.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.measures.metric_kernels import METRICS, VALUE
from rtsim.measures.metrics import TRIAL_METRICS, TrialMetrics
from rtsim.properties.formula import LARGEST_FORMULA, Flown, parse_property
from rtsim.properties.reader import Patient, rtamt
from rtsim.properties.words import TWIN, UNITS
from scenarios.campaign.events import EVENTS

DT = 0.1


def flown(**signals):
    """A flight of which only some signals are known."""
    length = max(len(values) for values in signals.values())
    rows = np.zeros((length, SIGNAL_COUNT))
    for name, values in signals.items():
        rows[:, getattr(COLUMN, name)] = values
    return Flown(rows, np.zeros(VALUE.size))


def rho(formula, twin=None, **signals):
    return parse_property(formula).robustness(flown(**signals), DT, twin)


# --- against rtamt's own monitor ---

comparisons = st.sampled_from(
    ["margin_kt > 1", "margin_kt <= 2.5", "margin_low_kt >= margin_kt", "abs(margin_kt) < 3", "2*margin_kt - 1 > 0"]
)
windows = st.tuples(st.integers(0, 6), st.integers(0, 6)).map(lambda pair: f"[{min(pair) / 10}:{max(pair) / 10}]")


def formulas(inner):
    unary = st.sampled_from(["not", "always", "eventually", "once", "historically", "rise", "fall", "prev", "next"])
    timed = st.sampled_from(["always", "eventually", "once", "historically"])
    binary = st.sampled_from(["and", "or", "implies", "until", "since"])
    return st.one_of(
        st.builds(lambda name, part: f"{name}({part})", unary, inner),
        st.builds(lambda name, window, part: f"{name}{window}({part})", timed, windows, inner),
        st.builds(lambda left, name, right: f"(({left}) {name} ({right}))", inner, binary, inner),
        st.builds(
            lambda left, name, window, right: f"(({left}) {name}{window} ({right}))",
            inner,
            st.sampled_from(["until", "since"]),
            windows,
            inner,
        ),
    )


traces = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=12)


@settings(max_examples=100, deadline=None)
@given(formula=st.recursive(comparisons, formulas, max_leaves=4), trace=traces)
def test_robustness_is_what_rtamt_says(formula, trace):
    first, second = (list(values) for values in zip(*trace, strict=True))
    oracle = rtamt.StlDiscreteTimeOfflineSpecification()
    for name in ("margin_kt", "margin_low_kt"):
        oracle.declare_var(name, "float")
    oracle.set_sampling_period(100, "ms", 0.1)
    oracle.spec = formula
    oracle.ast.parserErrorListenerType = Patient
    oracle.parse()
    times = [k * 100 for k in range(len(first) + 1)]
    # One frame more than is asked for: rtamt looks at the distance of the last two, and needs two.
    data = {"time": times[:-1], "margin_kt": list(first), "margin_low_kt": list(second)}
    if len(first) == 1:
        data = {"time": [0, 100], "margin_kt": first * 2, "margin_low_kt": second * 2}
        first, second = first * 2, second * 2
    wanted = oracle.evaluate(data)[0][1]
    found = rho(formula, margin_kt=first, margin_low_kt=second).value
    assert found == wanted or math.isclose(found, wanted, rel_tol=1e-12, abs_tol=1e-12)


# --- by hand ---


def test_the_least_margin_decides_when_and_by_how_much():
    found = rho("always (margin_kt > -0.5)", margin_kt=[4.0, 1.0, -2.0, 3.0])
    assert (found.value, found.unit, found.decides) == (-1.5, "kn", "margin_kt > -0.5")
    assert found.time == pytest.approx(0.2)
    assert found.broken
    assert found.words == "-1.5 kn"


def test_back_within_a_second():
    formula = "always ((mast_torque_inlb > 100) implies (eventually[0:1] (mast_torque_inlb < 100)))"
    beyond = [90.0] + [110.0] * 9 + [90.0] * 20
    assert not rho(formula, mast_torque_inlb=beyond).broken
    assert rho(formula, mast_torque_inlb=[90.0] + [110.0] * 15 + [90.0] * 20).broken


def test_beside_the_twin():
    twin = flown(altitude_m=[300.0, 299.0, 298.0])
    formula = "always (altitude_m - twin_altitude_m > -30)"
    assert parse_property(formula).needs_twin
    assert rho(formula, twin, altitude_m=[300.0, 280.0, 270.0, 0.0]).value == pytest.approx(2.0)  # as far as both went
    with pytest.raises(InputError, match="speaks of a twin without a law, and none was flown"):
        rho(formula, altitude_m=[300.0])


def test_the_unit_is_of_what_decides():
    formula = "always ((margin_kt > 0) and (pitch_deg < 20))"
    assert parse_property(formula).units == ("deg", "kn")
    assert rho(formula, margin_kt=[9.0, 9.0], pitch_deg=[5.0, 19.0]).unit == "deg"
    assert rho(formula, margin_kt=[9.0, 0.5], pitch_deg=[5.0, 19.0]).unit == "kn"


def test_every_metric_of_a_trial_can_be_written():
    numbers = np.arange(VALUE.size, dtype=np.float64)
    flight = Flown(np.zeros((3, SIGNAL_COUNT)), numbers)
    for name in set(TRIAL_METRICS) - set(COLUMN.asdict()):
        assert parse_property(f"{name} <= 0").robustness(flight, DT).value == -TrialMetrics(numbers)[name]


@pytest.mark.parametrize(
    ("event", "formula"),
    [
        ("exceeded", "exceedances <= 0"),
        ("deep", "(exceedances <= 0) or (depth_kt <= 5)"),
        ("flapping", "flapping_over_s <= 0"),
        ("bank", "bank_over_s <= 0"),
        ("sideslip", "sideslip_over_s <= 0"),
        ("torque", "torque_over_s <= 0"),
        ("height_harm", "height_lost_m - twin_height_lost_m <= 30"),
        ("delayed", "conversion_s - twin_conversion_s <= 0.5"),
    ],
)
def test_events_of_campaigns_can_be_written(event, formula):
    """A property broken where the event happened, on random metrics (their borders have no probability)."""
    random = np.random.default_rng(3)
    shape = (200, VALUE.size)
    law, off = (np.where(random.random(shape) < 0.4, 0.0, np.ceil(60 * random.random(shape))) for _ in "ab")
    happened = EVENTS[event](law, off)
    rows = np.zeros((2, SIGNAL_COUNT))
    broken = [
        parse_property(formula).robustness(Flown(rows, one), DT, Flown(rows, other)).broken
        for one, other in zip(law, off, strict=True)
    ]
    assert 0 < sum(broken) < 200
    assert broken == happened.tolist()


def test_what_a_flight_is_later_forgets_its_start():
    found = rho("always (margin_kt > 0)", margin_kt=[1.0] * 10 + [9.0] * 60)
    assert (found.value, found.later) == (1.0, 9.0)


def test_over_time_is_what_stands_behind_always():
    flight = flown(margin_kt=[4.0, 1.0, 3.0])
    assert parse_property("always (margin_kt > 0.5)").over_time(flight, DT).tolist() == [3.5, 0.5, 2.5]


def test_what_the_parser_has_to_look_at_twice_is_read():
    assert rho("always (2*margin_kt - 1 > 0)", margin_kt=[1.0, 2.0]).value == 1.0
    assert rho("always (2 > 2*margin_kt + margin_kt - 1)", margin_kt=[0.5, 0.0]).value == pytest.approx(1.5)


def test_both_or_none_and_one_of_them():
    formula = "always ((margin_kt > 1) {} (margin_low_kt > 1))"
    assert rho(formula.format("iff"), margin_kt=[2.0, 3.0], margin_low_kt=[2.5, 3.0]).value == -0.5
    assert rho(formula.format("xor"), margin_kt=[2.0, 3.0], margin_low_kt=[0.5, -1.0]).value == 1.5
    both = "((always[1:1] (margin_kt > 1)) iff (always[1:1] (margin_kt > 1)))"
    assert rho(both, margin_kt=[0.0]).value == 0.0  # where neither speaks of a frame


# --- mistakes ---


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        ("always (margn_kt > 1)", "neither a signal nor a metric.*margin_kt"),
        ("always (twin_margn_kt > 1)", "neither a signal nor a metric"),
        ("always (margin_kt > pitch_deg)", "compares deg with kn"),
        ("always (margin_kt + pitch_deg > 1)", "compares deg with kn"),
        ("always (margin_kt > -0.5", "cannot be read: missing '\\)'"),
        ("margin_kt + 1", "compares nothing"),
        ("margin_kt and (margin_kt > 1)", "compares nothing"),
        ("always[2:1] (margin_kt > 0)", "window that ends before it begins"),
        ("", "cannot be read"),
        ("always ((margin_kt > 1) > 2)", "cannot be read|compares nothing"),
        (
            "2 > margin_kt - 1 + 2*margin_kt",
            "would be read as .margin_kt - .1 . .2 . margin_kt",
        ),
        ("x = margin_kt > 1", "neither a signal nor a metric"),
        ("always (margin_kt > 1);" * 200, "is too long"),
        ("(" * (LARGEST_FORMULA // 2), "is too long"),
    ],
)
def test_mistakes_are_told_in_a_sentence(formula, words, capfd):
    with pytest.raises(InputError, match=words):
        parse_property(formula)
    assert capfd.readouterr().out == ""  # what the parser prints of its versions


@settings(max_examples=100, deadline=None)
@given(st.text(alphabet="abgtkn_()[]:<>=!&|+-*/.,;0123456789 'always", max_size=60))
def test_any_text_is_read_or_refused(text):
    found, told = None, "property."
    try:
        found = parse_property(text)
    except InputError as error:
        told = str(error)
    assert re.fullmatch(r"property[^\n]*[.?]", told)
    if found is not None:
        assert found.formula == text
        assert all(name.removeprefix(TWIN) in UNITS for name in found.names)


def test_names_are_those_of_the_declarations():
    assert len({item.name for item in METRICS}) == len(METRICS)
    assert parse_property("always (airspeed_kt < 400)").names == ("airspeed_kt",)
