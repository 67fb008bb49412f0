"""Boundaries to protect: computed from the plant, guarded by it, and compared with the charts."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import OUTPUT, STATE
from rtsim.aircraft.xv15.model import Xv15
from rtsim.choices import CORRIDOR_NAMES
from rtsim.corridor.boundaries import load_corridor
from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database
from rtsim.protection.boundary import (
    MODEL_PITCH,
    check_consistency,
    guarded_corridor,
    load_boundary,
    model_corridor,
    trim_range,
)
from rtsim.protection.limits import load_limits
from rtsim.units import deg, kt, to_deg, to_kt


@pytest.fixture(scope="module")
def database():
    return load_database()


@pytest.fixture(scope="module")
def computed(database):
    return model_corridor(database)


def test_every_named_boundary_loads_and_an_unknown_one_is_refused(database):
    assert [load_boundary(name, database).name for name in CORRIDOR_NAMES] == ["design", "flight", "model"]
    with pytest.raises(InputError, match="design, flight, model"):
        load_boundary("chart", database)


@pytest.mark.parametrize("nacelle", [35.0, 45.0, 55.0, 65.0])
def test_high_side_is_where_the_nonlinear_models_torque_reaches_its_limit(computed, nacelle):
    """The nonlinear model, trimmed on the computed line, needs the torque limit within 4 %."""
    speed = computed.high_speed(deg(nacelle))
    point = Xv15.load().trim(Condition(airspeed=speed, nacelle_angle=deg(nacelle)))
    assert point.converged
    assert point.y[OUTPUT.torque] == pytest.approx(load_limits().torque.cruise, rel=0.04)


@pytest.mark.parametrize("nacelle", [60.0, 65.0, 70.0])
def test_low_side_is_where_the_attitude_reaches_its_limit(computed, nacelle):
    speed = computed.low_speed(deg(nacelle))
    point = Xv15.load().trim(Condition(airspeed=speed, nacelle_angle=deg(nacelle)))
    assert point.converged
    assert to_deg(point.x[STATE.pitch]) == pytest.approx(to_deg(MODEL_PITCH), abs=1.0)


@pytest.mark.parametrize("nacelle", [0.0, 20.0, 40.0])
def test_below_the_low_side_of_the_wing_borne_part_there_is_no_unstalled_trim(database, computed, nacelle):
    speed = computed.low_speed(deg(nacelle))
    slower = Xv15.load().trim(Condition(airspeed=speed - kt(8.0), nacelle_angle=deg(nacelle)))
    assert not slower.converged or to_deg(slower.y[OUTPUT.wing_angle_of_attack]) > 15.0
    slowest, _ = trim_range(database)
    j = int(np.argmin(np.abs(database.nacelle - deg(nacelle))))
    assert speed == pytest.approx(slowest[j])


def test_guarded_corridor_is_inside_chart_and_plant(database):
    guard = kt(5.0)
    slowest, fastest = trim_range(database)
    for name in ("design", "flight", "model"):
        chart = load_boundary(name, database)
        guarded = guarded_corridor(chart, database, guard)
        angles = deg(np.linspace(0.0, 95.0, 381))
        assert np.all(np.asarray(guarded.low_speed(angles)) >= np.asarray(chart.low_speed(angles)) - 1e-9)
        assert np.all(np.asarray(guarded.high.at(angles)) <= np.asarray(chart.high.at(angles)) + 1e-9)
        for j, angle in enumerate(database.nacelle):
            assert guarded.low_speed(float(angle)) >= slowest[j] + guard - 1e-9
            assert guarded.high.at(float(angle)) <= fastest[j] - guard + 1e-9


def test_flight_chart_needs_no_guard_on_its_low_side(database):
    chart = load_corridor("flight")
    guarded = guarded_corridor(chart, database, kt(5.0))
    for nacelle in range(91):
        assert guarded.low_speed(deg(nacelle)) == pytest.approx(chart.low_speed(deg(nacelle)), abs=1e-9)


def test_consistency_check_finds_the_design_chart_inside_the_stall_and_not_the_flight_chart(database):
    """The 1975 chart allows what the plant stalls at; the power-on stall line of 1980 does not."""
    design = [item for item in check_consistency(load_corridor("design"), database) if item.side == "low"]
    worst = max(design, key=lambda item: item.depth)
    assert 10.0 < to_kt(worst.depth) < 20.0
    assert 30.0 < to_deg(worst.nacelle_deepest) < 60.0
    assert "stall or attitude" in worst.sentence()
    assert "12" in worst.sentence() or "13" in worst.sentence()
    flight = check_consistency(load_corridor("flight"), database)
    assert [item for item in flight if item.side == "low"] == []
    high = [item for item in flight if item.side == "high"]
    assert len(high) == 1
    assert to_deg(high[0].nacelle_to) == pytest.approx(90.0)
    assert "mast torque or trim" in high[0].sentence()


def test_computed_corridor_agrees_with_itself(database, computed):
    assert check_consistency(computed, database) == ()
