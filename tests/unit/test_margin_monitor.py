"""The margin monitor: distances, levels, normalized distance, flights, warnings."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.profile import xv15_profile
from rtsim.command import SENSOR, Command, Sensors
from rtsim.corridor.boundaries import load_corridor
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.kernels.compiled import interpreted
from rtsim.protection import monitor_kernels as kernels
from rtsim.protection.assessment import assess_warnings
from rtsim.protection.limits import LIMIT_KINDS, WATCHED, load_levels, load_limits
from rtsim.protection.monitor import (
    MarginHistory,
    MarginMonitor,
    MarginWatch,
    driven_of_rows,
    sensor_array,
    sensors_of_rows,
)
from rtsim.units import DEGREE, INCH_POUND, KNOT, deg, kt, to_deg, to_kt

ROOT = Path(__file__).resolve().parents[2]
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
    assert kernels.normalized_distance(tables, kt(150.0), deg(30.0), 0.0) == pytest.approx(2.0)
    assert kernels.normalized_distance(tables, kt(175.0), deg(30.0), 0.0) == pytest.approx(-0.5)
    assert kernels.normalized_distance(tables, kt(230.0), 0.0, 0.0) == pytest.approx(3.0)
    # A brute-force search over the boundary finds the same distance.
    angles = deg(np.linspace(0.0, 95.0, 190001))
    for speed, angle in ((80.0, 66.0), (100.0, 40.0), (20.0, 85.0), (120.0, 70.0)):
        best = math.inf
        for line in (corridor.low, corridor.high):
            x = (np.asarray(line.at(angles)) / KNOT - speed) / 10.0
            y = (angles / DEGREE - angle) / 10.0
            best = min(best, float(np.hypot(x, y).min()))
        got = kernels.normalized_distance(tables, kt(speed), deg(angle), 0.0)
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
    assert history.limits["stall_attitude"]["worst_margin"] == pytest.approx(
        85.0 - to_kt(load_corridor("flight").low_speed(deg(50.0)))
    )
    assert history.limits["stall_attitude"]["outside_s"] > 0.5
    assert history.levels[:, kernels.KIND.stall_attitude].max() == 3.0


def test_sensor_values_keep_the_order_of_the_sensors():
    values = sensor_array(CALM)
    assert len(values) == SENSOR.size == len(Sensors.__slots__)
    assert values[1] == CALM.airspeed
    assert values[13] == 0.0
    assert values[14] == 1.0


def test_watched_names_are_the_limits_and_the_time():
    assert WATCHED[: len(LIMIT_KINDS)] == LIMIT_KINDS
    assert len(WATCHED) == kernels.KIND.size


def test_limits_are_the_numbers_of_the_data_in_si():
    limits, data = load_limits(), xv15_profile().protection.data["limits"]
    assert to_deg(limits.flapping) == pytest.approx(data["flapping_deg"])
    assert to_deg(limits.nacelle_rate) == pytest.approx(data["nacelle_rate_deg_s"])
    assert to_kt(limits.plant_guard) == pytest.approx(data["plant_guard_kt"])
    assert limits.load_factor_min == data["load_factor_min"]
    assert limits.torque.takeoff == pytest.approx(data["mast_torque_takeoff_inlb"] * INCH_POUND)
    assert (limits.sink.floor, limits.sink.time) == (data["sink_rate_m_s"], data["sink_time_s"])


def test_what_is_watched_in_pieces_is_watched_as_a_whole(monitor):
    """Levels and least margins do not depend on how many rows are looked at together."""
    random = np.random.default_rng(2)
    sensors = np.tile(sensor_array(CALM), (900, 1))
    sensors[:, SENSOR.flapping] = deg(10.0 + 3.0 * np.sin(np.arange(900) / 90.0))
    sensors[:, SENSOR.load_factor] = 1.0 + random.standard_normal(900)
    ahead = np.full(900, 6.0)
    whole, pieces = (MarginWatch(monitor.tables, load_levels(), 0.004) for _ in range(2))
    margins, levels = whole.look(sensors, ahead)
    parts = [pieces.look(sensors[k : k + 7], ahead[k : k + 7]) for k in range(0, 900, 7)]
    assert np.array_equal(np.concatenate([part[0] for part in parts]), margins)
    assert np.array_equal(np.concatenate([part[1] for part in parts]), levels)
    assert levels[:, kernels.KIND.flap_stop].max() == 3.0
    found = whole.summary()
    assert found == pieces.summary()
    assert found["flap_stop"]["worst_margin"] == pytest.approx(-1.0, abs=1e-3)
    assert found["flap_stop"]["outside_s"] == np.count_nonzero(margins[:, kernels.KIND.flap_stop] < 0.0) * 0.004
    assert "downstop_gate" not in found


def watched_row(monitor, **columns):
    """Margins and the watch after one row with these columns; the others stand at a calm flight."""
    rows = np.zeros((200, SIGNAL_COUNT))
    calm = {"airspeed_kt": 105.0, "airspeed_indicated_kt": 105.0, "nacelle_deg": 50.0, "load_factor": 1.0}
    for name, value in (calm | {"altitude_m": 100.0, "time_to_limit_s": 6.0} | columns).items():
        rows[:, getattr(COLUMN, name)] = value
    watch = MarginWatch(monitor.tables, load_levels(), 0.004)
    margins, levels = watch.look(sensors_of_rows(rows), rows[:, COLUMN.time_to_limit_s].copy(), driven_of_rows(rows))
    named = dict(zip(WATCHED, margins[-1].tolist(), strict=True))
    return named, dict(zip(WATCHED, levels[-1].tolist(), strict=True)), watch.summary()


@pytest.mark.parametrize(("power", "level"), [(2600.0, 0.0), (2800.0, 1.0), (2950.0, 2.0), (3300.0, 3.0)])
def test_engine_power_is_held_against_what_there_is(monitor, power, level):
    columns = {"engine_power_shp": power, "engine_power_available_shp": 3000.0}
    margins, levels, summary = watched_row(monitor, **columns)
    assert margins["engine_power"] == pytest.approx(1.0 - power / 3000.0)
    assert levels["engine_power"] == level
    assert summary["engine_power"]["outside_s"] == (0.8 if power > 3000.0 else 0.0)


@pytest.mark.parametrize(("power", "angle", "margin", "level"), [
    (1856.0, 90.0, 0.2, 0.0), (2552.0, 90.0, -0.1, 1.0), (9280.0, 90.0, -3.0, 1.0), (2552.0, 79.0, None, 0.0),
])  # fmt: skip
def test_the_helicopter_transmission_cautions_and_no_more(monitor, power, angle, margin, level):
    """1160 shp an engine, in helicopter mode; a take-off may use more, so that it never warns."""
    margins, levels, summary = watched_row(monitor, power_shp=power, nacelle_deg=angle)
    assert margins["transmission"] == (kernels.FAR if margin is None else pytest.approx(margin))
    assert levels["transmission"] == level
    if margin is not None:
        assert summary["transmission"]["outside_s"] == (0.8 if margin < 0.0 else 0.0)


@pytest.mark.parametrize(("ratio", "angle", "limit"), [
    (0.0, 90.0, 0.1798), (0.057, 90.0, 0.1483), (0.456, 75.0, 0.0421), (0.6, 75.0, 0.0421), (0.114, 60.0, 0.1225),
    (0.228, 10.0, 0.0618), (0.228, 30.0, 0.0618), (0.285, 45.0, (0.0449 + 0.0685) / 2.0), (0.0285, 80.0, 0.16405),
])  # fmt: skip
def test_rotor_endurance_is_the_published_table(monitor, ratio, angle, limit):
    """NASA CR-166536 table 1-II, by advance ratio and nacelle angle; beyond it a caution, however far."""
    columns = {"advance_ratio": ratio, "nacelle_deg": angle}
    for load in (0.5 * limit, 1.5 * limit):
        margins, levels, _ = watched_row(monitor, thrust_coefficient_over_solidity=load, **columns)
        assert margins["rotor_endurance"] == pytest.approx(1.0 - load / limit)
        assert levels["rotor_endurance"] == (1.0 if load > limit else 0.0)


@given(ratio=st.floats(0.0, 0.8), angle=st.floats(0.0, 95.0))
def test_rotor_endurance_is_linear_between_its_points(ratio, angle):
    """Against numpy's interpolation, along the advance ratio and then along the angle."""
    tables = load_limits().rotor
    along = [np.interp(ratio, tables.advance_ratio, row) for row in tables.endurance]
    got = interpreted(kernels.endurance_limit)(tables, ratio, deg(angle))
    assert got == pytest.approx(np.interp(deg(angle), tables.nacelle, along), rel=1e-12)


def test_what_only_the_frame_knows_is_not_watched_from_sensors_alone(monitor):
    got = reading(monitor)
    for name in ("engine_power", "transmission", "rotor_endurance"):
        assert got.margins[name] == kernels.FAR
        assert got.levels[name] == "clear"


TOY = """
import importlib.util, json, sys
import numpy as np
from rtsim.aircraft.profile import xv15_profile

spec = importlib.util.spec_from_file_location("rtsim.protection.monitor_kernels", sys.argv[1])
module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
data = xv15_profile().protection.data
data["limits"]["climb_m_s"] = 9.0
data["levels"]["climb"] = {"unit": "m/s", "threshold": [2.0, 1.0, 0.0], "hysteresis": 0.5}

from rtsim.command import SENSOR
from rtsim.lpv.files.storage import load_database
from rtsim.protection.limits import LIMIT_KINDS, load_levels, load_limits
from rtsim.protection.monitor import MarginWatch, monitor_tables

watch = MarginWatch(monitor_tables("flight", load_database()), load_levels(), 0.1)
sensors = np.zeros((4, SENSOR.size))
sensors[:, SENSOR.climb_rate] = [1.0, 8.5, 8.5, 9.5]
margins, levels = watch.look(sensors, np.full(4, 6.0))
place = LIMIT_KINDS.index("climb")
print(json.dumps([watch.summary()["climb"], levels[:, place].tolist(), load_limits().climb, place]))
"""


def test_a_new_limit_needs_the_kernel_and_the_data_alone(tmp_path):
    """A toy limit has its margin, level, unit and number wherever limits are."""
    text = (ROOT / "rtsim/protection/monitor_kernels.py").read_text(encoding="utf-8")
    for place, line in (
        ('    "sideslip": "sideslip",\n', '    "climb": "climb rate",\n'),
        ("LIMIT_NUMBERS = {\n", '    "climb": ("climb_m_s", 0.0, 100.0),\n'),
        (
            "    nz = sensors[SENSOR.load_factor]\n",
            "    out[KIND.climb] = numbers[LIMIT.climb] - sensors[SENSOR.climb_rate]\n",
        ),
    ):
        assert text.count(place) == 1
        text = text.replace(place, place + line)
    (tmp_path / "monitor_kernels.py").write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", TOY, str(tmp_path / "monitor_kernels.py")]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=False)
    assert ended.returncode == 0, ended.stderr
    found, levels, number, place = json.loads(ended.stdout)
    assert found == {"worst_margin": -0.5, "unit": "m/s", "outside_s": 0.1}
    assert (levels, number, place) == ([0.0, 2.0, 2.0, 3.0], 9.0, len(LIMIT_KINDS))


def history_of(margin, predicted):
    time = 0.1 * np.arange(len(margin))
    margins = np.full((len(margin), kernels.KIND.size), 10.0)
    margins[:, kernels.KIND.stall_attitude] = margin
    zeros = np.zeros(len(margin))
    return MarginHistory(time, margins, margins * 0.0, zeros, np.asarray(predicted, float), zeros)


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
