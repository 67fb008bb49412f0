"""Properties of the corridor margins, and the compiled kernels against a plain numpy twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.choices import CHART_NAMES
from rtsim.corridor.boundaries import load_corridor
from rtsim.corridor.corridor_kernels import corridor_level_step, corridor_margins, new_level_state
from rtsim.units import deg, kt

TRAVEL = deg(95.0)
corridors = st.sampled_from([load_corridor(name) for name in CHART_NAMES])
airspeeds = st.floats(-60.0, 300.0).map(kt)
angles = st.floats(0.0, 95.0).map(deg)


def polygon(corridor):
    """Corners of the corridor as one closed outline, the downstop's step included."""
    low = list(zip(corridor.low.speed, corridor.low.nacelle, strict=True))
    high = [
        (corridor.downstop_speed, 0.0),
        (corridor.downstop_speed, corridor.downstop_nacelle),
        (corridor.high_speed(corridor.downstop_nacelle * (1.0 + 1e-9)), corridor.downstop_nacelle),
        *(
            (s, n)
            for s, n in zip(corridor.high.speed, corridor.high.nacelle, strict=True)
            if n > corridor.downstop_nacelle
        ),
    ]
    return np.array(high + low[::-1])


def in_polygon(corners, x, y):
    """Even-odd rule: count the edges that a ray to the right crosses."""
    x0, y0 = corners[:, 0], corners[:, 1]
    x1, y1 = np.roll(x0, -1), np.roll(y0, -1)
    crosses = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return bool(np.count_nonzero(crosses & (x < at)) % 2)


def distance_to_outline(corners, x, y):
    """Distance in scaled coordinates, to leave points on an edge out of the comparison."""
    a, b = corners, np.roll(corners, -1, axis=0)
    d = b - a
    length = np.maximum((d**2).sum(axis=1), 1e-300)
    t = np.clip(((np.array([x, y]) - a) * d).sum(axis=1) / length, 0.0, 1.0)
    return np.sqrt((((a + t[:, None] * d) - np.array([x, y])) ** 2).sum(axis=1)).min()


def twin_margins(corridor, airspeed, angle):
    """The margins by numpy and by search over a fine sweep of nacelle angles."""
    high = (
        corridor.downstop_speed
        if angle <= corridor.downstop_nacelle
        else np.interp(angle, corridor.high.nacelle, corridor.high.speed)
    )
    low = np.interp(angle, corridor.low.nacelle, corridor.low.speed)
    sweep = np.linspace(0.0, TRAVEL, 9501)  # 0.01 deg
    limit = np.where(
        sweep <= corridor.downstop_nacelle + 1e-12,
        corridor.downstop_speed,
        np.interp(sweep, corridor.high.nacelle, corridor.high.speed),
    )
    allowed = sweep[(np.interp(sweep, corridor.low.nacelle, corridor.low.speed) <= airspeed) & (airspeed <= limit)]
    return airspeed - low, high - airspeed, allowed


@given(corridors, airspeeds, angles)
def test_kernel_equals_the_numpy_twin(corridor, airspeed, angle):
    out = np.empty(4)
    corridor_margins(corridor.tables(), airspeed, angle, 0.0, out)
    low, high, allowed = twin_margins(corridor, airspeed, angle)
    assert out[0] == pytest.approx(low, abs=1e-9)
    assert out[1] == pytest.approx(high, abs=1e-9)
    step = deg(0.0101)
    if allowed.size:
        assert angle - allowed[0] <= out[2] + 1e-12
        assert out[2] <= angle - allowed[0] + step
        assert allowed[-1] - angle <= out[3] + 1e-12
        assert out[3] <= allowed[-1] - angle + step
    elif not corridor.low.speed[-1] <= airspeed <= corridor.downstop_speed:
        assert out[2] == out[3] == pytest.approx(-TRAVEL)


@given(corridors, airspeeds, angles)
def test_sign_of_the_margins_says_whether_the_point_is_in_the_polygon(corridor, airspeed, angle):
    corners = polygon(corridor)
    if distance_to_outline(corners, airspeed, angle) < 1e-6:
        return
    margins = corridor.margins(airspeed, angle)
    inside = in_polygon(corners, airspeed, angle)
    assert (min(margins.low, margins.high) > 0.0) == inside
    assert (min(margins.nacelle_forward, margins.nacelle_aft) > 0.0) == inside


@given(corridors, airspeeds, angles, st.floats(-1e-4, 1e-4), st.floats(-1e-5, 1e-5))
def test_speed_margins_are_continuous_off_the_downstop(corridor, airspeed, angle, change, turn):
    other = min(max(angle + turn, 0.0), TRAVEL)
    if min(angle, other) <= corridor.downstop_nacelle < max(angle, other):
        return
    first, second = corridor.margins(airspeed, angle), corridor.margins(airspeed + change, other)
    for margin, boundary in (("low", corridor.low), ("high", corridor.high)):
        steepest = np.abs(np.diff(boundary.speed) / np.diff(boundary.nacelle)).max()
        allowed = abs(change) + steepest * abs(other - angle) + 1e-12
        assert abs(getattr(first, margin) - getattr(second, margin)) <= allowed


@given(corridors, angles, st.floats(-34.9, 119.0).map(kt), st.floats(0.0, 1e-6))
def test_nacelle_margins_are_continuous_in_airspeed_across_the_low_side(corridor, angle, airspeed, change):
    first, second = corridor.margins(airspeed, angle), corridor.margins(airspeed + change, angle)
    sloping = np.diff(corridor.low.speed) != 0.0
    flattest = np.abs(np.diff(corridor.low.nacelle)[sloping] / np.diff(corridor.low.speed)[sloping]).max()
    assert abs(first.nacelle_forward - second.nacelle_forward) <= flattest * change + 1e-12


@given(st.lists(st.floats(-10.0, 20.0), min_size=1, max_size=400), st.sampled_from([0.004, 0.01]))
def test_level_kernel_equals_the_rule_written_with_frame_counts(margins_kt, dt):
    corridor = load_corridor("design")
    state, tables = new_level_state(), corridor.tables()
    thresholds, up, down = (10.0, 4.0, 0.0), round(0.1 / dt), round(1.0 / dt)
    active, since = [False] * 3, [0] * 3
    for margin_kt in margins_kt:
        margin = kt(margin_kt)
        for k, threshold in enumerate(thresholds):
            changing = margin > kt(threshold) + kt(1.5) if active[k] else margin < kt(threshold)
            since[k] = since[k] + 1 if changing else 0
            if since[k] == (down if active[k] else up):
                active[k], since[k] = not active[k], 0
        expected = max((k + 1 for k in range(3) if active[k]), default=0)
        assert corridor_level_step(tables, margin, dt, state) == expected
