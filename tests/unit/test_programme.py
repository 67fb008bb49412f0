"""Programmes: the paper's timing rule, interpolation, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.errors import InputError
from rtsim.programme import MAX_NACELLE_RATE, Programme, Waypoint, timed_programme
from rtsim.units import deg, kt, to_deg, to_kt

# Table 1 of the paper: airspeed [kn], nacelle [deg], acceleration cap of the segment that leads there [kn/s].
TABLE_1 = (
    (0, 90, 3), (24, 82, 3), (40, 82, 3), (61, 75, 3), (80, 75, 3),
    (105, 50, 3), (130, 50, 4), (150, 0, 4), (170, 0, 5),
)  # fmt: skip
PRINTED_TIMES = (0.0, 8.0, 13.3, 20.3, 26.6, 34.9, 41.2, 57.9, 61.9, 65.9)


def table_1(nacelle_rate_deg_s: float = 3.0) -> list[Waypoint]:
    """The waypoints of Table 1."""
    points = [
        Waypoint(kt(v), deg(n), 100.0, acceleration=kt(a), nacelle_rate=deg(nacelle_rate_deg_s)) for v, n, a in TABLE_1
    ]
    last = points[-1]
    points[-1] = Waypoint(last.airspeed, last.nacelle_angle, 100.0, last.acceleration, last.nacelle_rate, hold=4.0)
    return points


def test_the_rule_gives_the_printed_time_row_of_table_1() -> None:
    programme = timed_programme(table_1())
    # The paper prints the cumulative times truncated to 0.1 s, truncating 35.0 - eps to 34.9.
    assert programme.time == pytest.approx(PRINTED_TIMES, abs=0.101)
    exact = [0, 8, 40 / 3, 61 / 3, 80 / 3, 35, 41.25, 41.25 + 50 / 3, 45.25 + 50 / 3, 49.25 + 50 / 3]
    assert programme.time == pytest.approx(exact, abs=1e-9)


def test_ramps_at_the_rate_then_hold_and_end_at_the_same_time() -> None:
    spread, ramped = timed_programme(table_1()), timed_programme(table_1(), nacelle_motion="rate")
    assert ramped.duration == pytest.approx(spread.duration)
    rates = to_deg(1.0) * np.abs(np.diff(ramped.nacelle_angle) / np.diff(ramped.time))
    moving = rates[rates > 1e-9]
    assert moving == pytest.approx(np.full(len(moving), 3.0))
    assert to_deg(ramped.at(8.0 / 3.0).nacelle_angle) == pytest.approx(82.0)
    assert to_kt(ramped.at(8.0 / 3.0).airspeed) == pytest.approx(8.0)


def test_at_eight_degrees_a_second_only_the_last_tilt_shortens() -> None:
    slow, fast = timed_programme(table_1()), timed_programme(table_1(8.0))
    assert np.diff(fast.time)[:6] == pytest.approx(np.diff(slow.time)[:6])
    assert np.diff(fast.time)[6] == pytest.approx(50.0 / 8.0)


def test_at_holds_before_and_after_and_rates_follow_segments() -> None:
    programme = timed_programme(table_1())
    assert programme.at(-5.0) == programme.at(0.0)
    assert to_kt(programme.at(1e6).airspeed) == pytest.approx(170.0)
    assert to_kt(programme.rates_at(0.0).airspeed) == pytest.approx(3.0)
    assert to_deg(programme.rates_at(0.0).nacelle_angle) == pytest.approx(-1.0)
    assert programme.rates_at(8.0).nacelle_angle == 0.0
    assert programme.rates_at(1e6).airspeed == 0.0


@given(start=st.floats(0.0, 65.0), later=st.floats(0.0, 80.0))
def test_joining_late_flies_the_same_from_there(start: float, later: float) -> None:
    programme = timed_programme(table_1())
    joined = programme.starting_at(start)
    before, after = programme.at(start + later), joined.at(later)
    assert after.airspeed == pytest.approx(before.airspeed, abs=1e-6)
    assert after.nacelle_angle == pytest.approx(before.nacelle_angle, abs=1e-7)


def test_round_trip_through_plain_lists_is_exact() -> None:
    programme = timed_programme(table_1()).raised(50.0)
    again = Programme.from_dict(programme.to_dict())
    for name in ("time", "airspeed", "nacelle_angle", "altitude"):
        assert np.array_equal(getattr(again, name), getattr(programme, name))


def test_arrays_are_read_only_copies() -> None:
    time = np.array([0.0, 10.0])
    programme = Programme(time, np.zeros(2), np.zeros(2), np.zeros(2))
    time[1] = 5.0
    assert programme.duration == 10.0
    with pytest.raises(ValueError, match="read-only"):
        programme.time[0] = 1.0


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        (([], [], [], []), "no points"),
        (([1.0], [0.0], [0.0], [0.0]), "first time must be 0"),
        (([0.0, 2.0, 2.0], [0.0] * 3, [0.0] * 3, [0.0] * 3), "not later than the point before"),
        (([0.0, np.nan], [0.0] * 2, [0.0] * 2, [0.0] * 2), "not a number"),
        (([0.0, 1.0], [0.0], [0.0] * 2, [0.0] * 2), "one value per point"),
        (([0.0], [kt(261.0)], [0.0], [0.0]), "-40 to 260 kn"),
        (([0.0], [np.nan], [0.0], [0.0]), "out of range"),
        (([0.0], [0.0], [deg(-1.0)], [0.0]), "0 to 90 deg"),
        (([0.0], [0.0], [0.0], [-6.0]), "-5 to 10000 m"),
        (([0.0, 1.0], [0.0] * 2, [deg(90.0), deg(77.9)], [0.0] * 2), "at most 12 deg/s"),
    ],
)
def test_refuses_what_cannot_be_flown(arrays: tuple[list[float], ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Programme(*(np.array(values, dtype=float) for values in arrays))


def test_the_fastest_assigned_rate_is_allowed() -> None:
    programme = timed_programme([
        Waypoint(0.0, deg(90.0), 0.0),
        Waypoint(0.0, 0.0, 0.0, nacelle_rate=MAX_NACELLE_RATE),
    ])  # fmt: skip
    assert programme.duration == pytest.approx(7.5)


def test_waypoints_without_length_or_rate_are_refused() -> None:
    with pytest.raises(InputError, match="without a hold"):
        timed_programme([Waypoint(0.0, 0.0, 0.0), Waypoint(0.0, 0.0, 0.0)])
    with pytest.raises(InputError, match="positive"):
        timed_programme([Waypoint(0.0, 0.0, 0.0), Waypoint(1.0, 0.0, 0.0, acceleration=0.0)])
    with pytest.raises(InputError, match="no points"):
        timed_programme([])
