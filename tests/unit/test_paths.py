"""Conversion paths as data: the paper's timing rule, caps by region, reversal, and scenario files that read back."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.optimization.path import AccelerationCaps, ConversionPath, PathPoint, path_through
from rtsim.optimization.paths import (
    PATH_NAMES,
    centre_line_corners,
    centre_line_variable,
    corridor_distance_kt,
    fast_side,
    near_stall,
    paper_path,
    table_1,
    trim_flapping_map,
)
from rtsim.units import deg, kt, to_kt
from scenarios.files.loader import parse_scenario


def test_table_1_has_the_printed_times():
    programme = table_1().programme()
    printed = {0.0: 0.0, 24.0: 8.0, 40.0: 13.333, 61.0: 20.333, 80.0: 26.667, 105.0: 35.0, 130.0: 41.25, 150.0: 57.917}
    for airspeed, time in printed.items():
        reached = np.interp(kt(airspeed), programme.airspeed[:-1], programme.time[:-1])
        assert reached == pytest.approx(time, abs=2e-3)
    assert programme.duration == pytest.approx(65.917, abs=2e-3)


def test_table_1_moves_the_nacelles_at_their_rate_and_waits():
    programme = table_1(nacelle_rate_deg_s=8.0).programme()
    rates = np.diff(programme.nacelle_angle) / np.diff(programme.time)
    moving = rates[np.abs(rates) > 1e-9]
    assert np.allclose(moving, -deg(8.0))
    assert len(moving) == 4


def test_caps_belong_to_the_nacelle_angle_of_the_segment():
    caps = AccelerationCaps()
    assert [caps.at(*segment) for segment in ((90, 82), (75, 50), (50, 50), (50, 0), (0, 0))] == [3, 3, 4, 4, 5]
    assert AccelerationCaps.uniform(2.0).at(0.0, 0.0) == 2.0


@pytest.mark.parametrize("rate", [3.0, 8.0])
@pytest.mark.parametrize("name", PATH_NAMES)
def test_every_path_converts_within_its_rates(name, rate):
    path = paper_path(name, nacelle_rate_deg_s=rate)
    assert path.converts
    first, last = path.points[0], path.points[-1]
    assert (first.airspeed_kt, first.nacelle_deg) == (0.0, 90.0)
    assert (last.airspeed_kt, last.nacelle_deg) == (170.0, 0.0)
    for before, after in itertools.pairwise(path.points):
        assert after.airspeed_kt >= before.airspeed_kt
        assert after.nacelle_deg <= before.nacelle_deg
    programme = path.programme()
    largest = max(point.nacelle_rate_deg_s for point in path.points)
    assert np.abs(np.diff(programme.nacelle_angle) / np.diff(programme.time)).max() <= deg(largest) * (1 + 1e-9)
    cap = max(point.acceleration_kt_s for point in path.points[1:])
    assert np.abs(np.diff(programme.airspeed) / np.diff(programme.time)).max() <= kt(cap) * (1 + 1e-9)


@pytest.mark.parametrize("name", PATH_NAMES)
def test_every_path_lies_inside_the_corridor(name):
    assert corridor_distance_kt(paper_path(name)) > 5.0


def test_near_stall_keeps_its_distance_to_the_stall_line():
    assert corridor_distance_kt(near_stall(), corridor="flight") == pytest.approx(5.0, abs=1.0)


def test_the_centre_line_is_the_mean_of_both_boundaries():
    corners = {nacelle: airspeed for airspeed, nacelle in centre_line_corners()[1:-1]}
    assert corners[90.0] == pytest.approx(62.5, abs=0.1)
    assert corners[50.0] == pytest.approx(115.9, abs=0.5)
    assert corners[0.0] == pytest.approx(135.5, abs=0.1)


def test_the_variable_rate_peaks_where_the_paper_says():
    programme = centre_line_variable(acceleration_kt_s=4.0).programme()
    rates = -np.diff(programme.nacelle_angle) / np.diff(programme.time) / deg(1.0)
    assert 10.0 <= rates.max() <= 12.0 + 1e-9
    assert (rates > 10.0).sum() < len(rates) / 2


def test_the_fast_side_runs_at_higher_speed_than_the_centre_line():
    fast = {point.nacelle_deg: point.airspeed_kt for point in fast_side().points[1:-1]}
    centre = {nacelle: airspeed for airspeed, nacelle in centre_line_corners()[1:-1]}
    upper = [nacelle for nacelle in fast if nacelle >= 60.0]
    assert len(upper) >= 5
    assert all(fast[nacelle] > centre[nacelle] for nacelle in upper)


def test_the_trim_flapping_map_has_its_ridge_at_low_speed():
    airspeeds, nacelles, flapping = trim_flapping_map()
    assert flapping.shape == (len(airspeeds), len(nacelles))
    helicopter = flapping[:, int(np.argmin(np.abs(nacelles - 90.0)))]
    ridge = airspeeds[int(np.nanargmax(np.where(airspeeds > 0.0, helicopter, np.nan)))]
    assert 20.0 <= ridge <= 50.0
    with pytest.raises(ValueError, match="read-only"):
        flapping[0, 0] = 1.0


@pytest.mark.parametrize("name", PATH_NAMES)
def test_a_reconversion_is_the_path_backwards_within_its_caps(name):
    path = paper_path(name)
    back = paper_path(name, reconversion=True)
    assert not back.converts
    assert [(p.airspeed_kt, p.nacelle_deg) for p in back.points] == [
        (p.airspeed_kt, p.nacelle_deg) for p in path.points[::-1]
    ]
    programme = back.programme()
    assert np.diff(programme.airspeed / kt(1.0)).max() <= 1e-9
    assert (-np.diff(programme.airspeed) / np.diff(programme.time)).max() <= kt(2.0) * (1 + 1e-9)
    assert back.points[-1].hold_s > 0.0


@pytest.mark.parametrize("reconversion", [False, True])
@pytest.mark.parametrize("name", PATH_NAMES)
def test_a_scenario_file_gives_the_identical_programme(name, reconversion):
    path = paper_path(name, nacelle_rate_deg_s=7.3, reconversion=reconversion)
    text = path.to_scenario_toml(
        flight={"plant": "lpv", "rate_hz": 250, "pilot_noise": False},
        expectations=[("holds altitude", "altitude_m.max_deviation", None, 4.5)],
    )
    scenario, problems = parse_scenario(text, file="made")
    assert problems == []
    for column in ("time", "airspeed", "nacelle_angle", "altitude"):
        assert np.array_equal(getattr(scenario.programme, column), getattr(path.programme(), column))
    assert scenario.name == path.name
    assert scenario.expectations[0].maximum == 4.5


def test_texts_with_quotes_survive_the_scenario_file():
    points = (PathPoint(0.0, 90.0), PathPoint(20.0, 80.0))
    path = ConversionPath("odd", 'a "quoted" \\ title', points, description="two\nlines, ünïcode")
    scenario, problems = parse_scenario(path.to_scenario_toml(), file="made")
    assert problems == []
    assert scenario.title == 'a "quoted" \\ title'
    assert scenario.description == "two\nlines, ünïcode"


def test_repeated_corners_are_left_out():
    path = path_through("short", "Short", [(0, 90), (0, 90), (170, 0), (170, 0)])
    assert len(path.points) == 2
    assert to_kt(float(path.programme().airspeed[-1])) == pytest.approx(170.0)


def test_rates_can_be_exchanged():
    path = table_1().with_rates(nacelle_rate_deg_s=8.0, caps=AccelerationCaps.uniform(1.0), name="slow")
    assert {point.nacelle_rate_deg_s for point in path.points[1:]} == {8.0}
    assert {point.acceleration_kt_s for point in path.points[1:]} == {1.0}
    assert path.points[-1].hold_s == table_1().points[-1].hold_s


def test_what_is_no_path_is_refused():
    with pytest.raises(InputError, match="at least two points"):
        ConversionPath("one", "One", (PathPoint(0.0, 90.0),))
    with pytest.raises(InputError, match="is not a path"):
        paper_path("unknown")
