"""The margin monitor: distances, levels, normalized distance, flights, warnings."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from rtsim.command import SENSOR, Command, Sensors
from rtsim.corridor.boundaries import load_corridor
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.protection import monitor_kernels as kernels
from rtsim.protection.assessment import assess_warnings
from rtsim.protection.limits import LIMIT_KINDS, WATCHED, load_levels
from rtsim.protection.monitor import MarginHistory, MarginMonitor, sensor_array, sensors_of_rows, severity
from rtsim.units import DEGREE, INCH_POUND, KNOT, deg, kt, to_deg, to_kt

CALM = Sensors(
    time=0.0, airspeed=kt(105.0), airspeed_rate=0.0, nacelle_angle=deg(50.0), nacelle_rate=0.0, pitch=0.0,
    pitch_rate=0.0, flight_path_angle=0.0, altitude=100.0, climb_rate=0.0, load_factor=1.0,
    mast_torque=65000.0 * INCH_POUND, flapping=deg(2.0), on_downstop=False, nacelle_ok=True,
)  # fmt: skip
LEVEL = Command(0.1, 0.45, 0.0)


@pytest.fixture(scope="module")
def monitor():
    return MarginMonitor("flight")


def reading(monitor, **changes):
    monitor.reset()
    return monitor.step(dataclasses.replace(CALM, **changes), LEVEL)


def test_margins_are_signed_distances(monitor):
    corridor = load_corridor("flight")
    got = reading(monitor).margins
    assert got["stall_attitude"] == pytest.approx(kt(105.0) - corridor.low_speed(deg(50.0)))
    assert got["load_torque"] == pytest.approx(corridor.high_speed(deg(50.0)) - kt(105.0))
    assert to_deg(got["nacelle_range"]) == pytest.approx(40.0)
    assert to_deg(got["nacelle_rate"]) == pytest.approx(12.0)
    assert to_deg(got["flap_stop"]) == pytest.approx(10.0)
    assert got["mast_torque"] == pytest.approx(0.5)
    assert got["load_factor"] == pytest.approx(1.5)
    assert to_deg(got["pitch_attitude"]) == pytest.approx(25.0)
    assert got["sink"] == pytest.approx(6.0)
    assert got["downstop_gate"] == kernels.FAR


@pytest.mark.parametrize(
    ("limit", "changes"),
    [
        ("stall_attitude", {"airspeed": kt(80.0)}),
        ("load_torque", {"airspeed": kt(166.0)}),
        ("downstop_gate", {"airspeed": kt(171.0), "nacelle_angle": 0.0, "on_downstop": True}),
        ("nacelle_rate", {"nacelle_rate": -deg(12.5)}),
        ("flap_stop", {"flapping": deg(12.1)}),
        ("mast_torque", {"mast_torque": 131000.0 * INCH_POUND}),
        ("load_factor", {"load_factor": 3.1}),
        ("load_factor", {"load_factor": -0.6}),
        ("pitch_attitude", {"pitch": -deg(25.1)}),
        ("sink", {"climb_rate": -6.1}),
        ("consistency", {"airspeed": kt(70.0)}),
        ("consistency", {"airspeed": kt(270.0)}),
    ],
)
def test_a_margin_is_negative_exactly_where_its_limit_is_passed(monitor, limit, changes):
    assert reading(monitor, **changes).margins[limit] < 0.0
    assert reading(monitor).margins[limit] > 0.0


def test_take_off_torque_holds_in_helicopter_mode_only(monitor):
    torque = 140000.0 * INCH_POUND
    slow = {"airspeed": kt(30.0), "nacelle_angle": deg(85.0), "mast_torque": torque}
    assert reading(monitor, **slow).margins["mast_torque"] == pytest.approx(1.0 - 140.0 / 163.0)
    assert reading(monitor, **{**slow, "airspeed": kt(61.0)}).margins["mast_torque"] < 0.0


def test_more_sink_is_allowed_fast_and_high(monitor):
    low = reading(monitor).margins["sink"]
    assert reading(monitor, airspeed=kt(150.0)).margins["sink"] == pytest.approx(kt(150.0) * math.sin(deg(6.0)))
    assert reading(monitor, altitude=500.0).margins["sink"] == pytest.approx(low + 200.0 / 20.0)


def test_levels_wait_to_rise_and_wait_longer_to_fall(monitor):
    """Flapping 12.1 deg for 0.1 s is an exceedance; back at 2 deg the level ends after 1 s."""
    monitor.reset()
    high = dataclasses.replace(CALM, flapping=deg(12.1))
    levels = [monitor.step(high, LEVEL).levels["flap_stop"] for _ in range(26)]
    assert levels[23] == "clear"
    assert levels[25] == "exceedance"
    levels = [monitor.step(CALM, LEVEL).levels["flap_stop"] for _ in range(251)]
    assert levels[0] == levels[247] == "exceedance"
    assert levels[250] == "clear"


def test_hysteresis_keeps_a_level_near_its_threshold(monitor):
    """Margin 1.4 deg warns (below 1.5); 1.9 deg does not end it (1.5 + 0.5 not reached); 2.1 deg does."""
    monitor.reset()
    for _ in range(30):
        monitor.step(dataclasses.replace(CALM, flapping=deg(10.6)), LEVEL)
    for _ in range(400):
        near = monitor.step(dataclasses.replace(CALM, flapping=deg(10.1)), LEVEL)
    assert near.levels["flap_stop"] == "warning"
    for _ in range(400):
        off = monitor.step(dataclasses.replace(CALM, flapping=deg(9.9)), LEVEL)
    assert off.levels["flap_stop"] == "caution"


def test_normalized_distance_is_euclidean_and_signed(monitor):
    corridor = load_corridor("flight")
    tables = monitor.tables
    # Beside the flat high side the distance is the speed margin in tens of knots.
    assert kernels.normalized_distance(tables, kt(150.0), deg(30.0)) == pytest.approx(2.0)
    assert kernels.normalized_distance(tables, kt(175.0), deg(30.0)) == pytest.approx(-0.5)
    assert kernels.normalized_distance(tables, kt(230.0), 0.0) == pytest.approx(3.0)
    # A brute-force search over the boundary finds the same distance.
    angles = deg(np.linspace(0.0, 95.0, 190001))
    for speed, angle in ((80.0, 66.0), (100.0, 40.0), (20.0, 85.0), (120.0, 70.0)):
        best = math.inf
        for line in (corridor.low, corridor.high):
            x = (np.asarray(line.at(angles)) / KNOT - speed) / 10.0
            y = (angles / DEGREE - angle) / 10.0
            best = min(best, float(np.hypot(x, y).min()))
        got = kernels.normalized_distance(tables, kt(speed), deg(angle))
        assert abs(got) == pytest.approx(best, abs=2e-3)
        assert (got > 0.0) == corridor.inside(kt(speed), deg(angle))


def test_time_to_limit_of_a_steady_deceleration(monitor):
    """Losing 3 kn/s from 12 kn above the stall line, the limit is announced some seconds ahead, and its side."""
    monitor.reset()
    assert monitor.step(CALM, LEVEL).margins["time_to_limit"] > 0.0
    corridor = load_corridor("flight")
    speed = corridor.low_speed(deg(50.0)) + kt(12.0)
    # What the model does not expect is learned within a second.
    for _ in range(250):
        slowing = dataclasses.replace(CALM, airspeed=speed, airspeed_rate=-kt(3.0), pitch=deg(4.0))
        got = monitor.step(slowing, LEVEL)
    assert 2.0 < got.time_to_limit < 6.0
    assert got.side == "low"


def test_history_equals_the_monitor_in_flight(monitor):
    rng = np.random.default_rng(5)
    rows = np.zeros((400, SIGNAL_COUNT))
    rows[:, COLUMN.time_s] = 0.004 * np.arange(400)
    rows[:, COLUMN.airspeed_kt] = rows[:, COLUMN.airspeed_indicated_kt] = np.linspace(100.0, 85.0, 400)
    rows[:, COLUMN.airspeed_rate_kt_s] = -9.4
    rows[:, COLUMN.nacelle_deg] = 50.0
    rows[:, COLUMN.load_factor] = 1.0 + 0.1 * rng.normal(size=400)
    rows[:, COLUMN.altitude_m] = 100.0
    rows[:, COLUMN.mast_torque_inlb] = 60000.0
    rows[:, COLUMN.lever], rows[:, COLUMN.stick] = 0.3, 0.1
    history = monitor.history(rows)
    monitor.reset()
    for k, known in enumerate(sensors_of_rows(rows)):
        sensors = Sensors(*known[:13], bool(known[13]), bool(known[14]))
        got = monitor.step(sensors, Command(0.1, 0.3, 0.0))
        assert list(got.margins.values()) == history.margins[k].tolist()
        names = ("clear", "caution", "warning", "exceedance")
        assert list(got.levels.values()) == [names[int(level)] for level in history.levels[k]]
        assert got.normalized_distance == history.normalized_distance[k]
    assert history.summary()["stall_attitude"]["worst"] == pytest.approx(
        85.0 - to_kt(load_corridor("flight").low_speed(deg(50.0)))
    )
    assert history.summary()["stall_attitude"]["outside_s"] > 0.5
    assert history.summary()["stall_attitude"]["level"] == 3.0


def test_sensor_values_keep_the_order_of_the_sensors():
    values = sensor_array(CALM)
    assert len(values) == SENSOR.size == len(Sensors.__slots__)
    assert values[1] == CALM.airspeed
    assert values[13] == 0.0
    assert values[14] == 1.0


def test_watched_names_are_the_limits_and_the_time():
    assert WATCHED[: len(LIMIT_KINDS)] == LIMIT_KINDS
    assert len(WATCHED) == kernels.KIND_COUNT


@pytest.mark.parametrize(
    ("depth", "duration", "lost", "word"),
    [(-1.0, 0.0, False, "none"), (3.0, 1.0, False, "minor"), (3.0, 2.5, False, "major"), (7.0, 1.0, False, "major"),
     (15.1, 0.2, False, "critical"), (0.0, 0.0, True, "critical")],
)  # fmt: skip
def test_severity(depth, duration, lost, word):
    assert severity(kt(depth), duration, lost=lost) == word


def history_of(margin, predicted):
    time = 0.1 * np.arange(len(margin))
    margins = np.full((len(margin), kernels.KIND_COUNT), 10.0)
    margins[:, kernels.KIND_STALL] = margin
    zeros = np.zeros(len(margin))
    return MarginHistory(time, margins, margins * 0.0, zeros, np.asarray(predicted, float), zeros, load_levels())


def test_assessment_of_a_perfect_and_of_a_late_prediction():
    margin = 5.0 - 0.1 * np.arange(100)
    crossing = 5.1  # the first sample below zero
    truth = np.clip(crossing - 0.1 * np.arange(100), 0.0, 6.0)
    perfect = assess_warnings([history_of(margin, truth)])
    assert [lead.detected for lead in perfect.leads] == [1.0] * 5
    assert max(abs(lead.bias) for lead in perfect.leads) < 1e-9
    assert (perfect.alarms, perfect.false_alarms) == (1, 0)
    late = assess_warnings([history_of(margin, np.minimum(truth + 0.4, 6.0))])
    assert [lead.bias for lead in late.leads] == pytest.approx([0.4] * 5)
    never = assess_warnings([history_of(np.full(100, 5.0), np.where(np.arange(100) == 20, 1.0, 6.0))])
    assert (never.alarms, never.false_alarms) == (1, 1)
    blind = assess_warnings([history_of(margin, np.full(100, 6.0))])
    assert [lead.detected for lead in blind.leads] == [0.0] * 5
    assert math.isnan(blind.leads[0].bias)
