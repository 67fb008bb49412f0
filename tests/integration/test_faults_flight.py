"""Failures in the closed loop, on both plants, scheduled and live, and their events from scenario to replay."""

from __future__ import annotations

import numpy as np
import pytest

from rtsim.faults import fault_kernels as kernels
from rtsim.faults.fault import Fault, FaultSwitch
from rtsim.frame import COLUMN, history_sha256
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.realtime.control import FlightControl
from rtsim.units import HORSEPOWER, deg, kt

PLANTS = ["lpv", "nonlinear"]


def hold(airspeed, nacelle, **changes):
    programme = Programme.hold(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), altitude=100.0)
    faults = changes.pop("faults", ())
    return FlightSetup(programme=programme, faults=faults).with_options(**changes)


def conversion(**changes):
    """From 60 kn, 82.5 deg to 80 kn, 75 deg in 8 s."""
    programme = Programme(
        np.array([0.0, 8.0]), kt(np.array([60.0, 80.0])), deg(np.array([82.5, 75.0])), np.full(2, 100.0)
    )
    faults = changes.pop("faults", ())
    return FlightSetup(programme=programme, faults=faults).with_options(**changes)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_scheduled_failure_is_the_same_however_it_is_flown(plant):
    faults = (
        Fault(kind="actuator-slow", actuator="cyclic", start=0.5, end=1.2, rate=deg(1.0)),
        Fault(kind="nacelle-jammed", start=1.0),
        Fault(kind="airspeed-bias", start=0.3, bias=kt(4.0)),
        Fault(kind="engine-limit", start=0.0, power=400.0 * HORSEPOWER, other_engine="military"),
    )
    setup = conversion(plant=plant, faults=faults)
    simulation = Simulation(setup)
    stepped = np.array([simulation.step() for _ in range(500)])
    simulation.reset()
    pieces = [simulation.run(77)]
    snapshot = simulation.snapshot()
    pieces.append(simulation.run(423))
    assert history_sha256([stepped]) == history_sha256(pieces)
    simulation.restore(snapshot)
    np.testing.assert_array_equal(simulation.run(423), pieces[1])
    masks = stepped[:, COLUMN.failures]
    engine, airspeed, cyclic, jam = (
        kernels.MASK_ENGINE, kernels.MASK_AIRSPEED, kernels.MASK_CYCLIC, kernels.MASK_JAMMED,
    )  # fmt: skip
    assert masks[0] == engine
    assert masks[75] == engine + airspeed
    assert masks[125] == masks[249] == engine + airspeed + cyclic
    assert masks[250] == engine + airspeed + cyclic + jam
    assert masks[300] == engine + airspeed + jam


def test_a_jam_stops_the_nacelles_and_is_seen():
    simulation = Simulation(conversion(faults=(Fault(kind="nacelle-jammed", start=4.0, end=12.0),)))
    assert simulation.sensors().nacelle_ok
    rows = simulation.run(2000)
    angle = rows[:, COLUMN.nacelle_deg]
    assert not simulation.sensors().nacelle_ok
    assert angle[1000] - angle[-1] == pytest.approx(-rows[1000, COLUMN.nacelle_rate_deg_s] / 3.0, rel=0.01)
    assert abs(rows[-1, COLUMN.nacelle_rate_deg_s]) < 1e-3
    assert np.abs(rows[1001:, COLUMN.nacelle_command_rate_deg_s]).max() == 0.0
    rows = simulation.run(2000)
    assert simulation.sensors().nacelle_ok
    assert rows[-1, COLUMN.nacelle_deg] == pytest.approx(75.0, abs=0.1)


def test_slow_nacelles_lag_the_programme():
    rows = Simulation(conversion(faults=(Fault(kind="nacelle-slow", start=0.0, rate=deg(0.5)),))).run(2000)
    assert rows[:, COLUMN.nacelle_rate_deg_s].min() == pytest.approx(-0.5, abs=1e-6)
    assert rows[-1, COLUMN.nacelle_deg] == pytest.approx(82.5 - 0.5 * (7.996 - 2.0 / 3.0), abs=0.01)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("actuator", "column"),
    [("collective", "collective_75_deg"), ("cyclic", "cyclic_deg"), ("elevator", "elevator_deg")],
)
def test_a_stuck_actuator_stands_still_while_the_pilot_moves(plant, actuator, column):
    fault = Fault(kind="actuator-stuck", actuator=actuator, start=2.0, end=3.0)
    rows = Simulation(conversion(plant=plant, faults=(fault,))).run(1000)
    angle = rows[:, getattr(COLUMN, column)]
    assert np.ptp(angle[500:751]) == 0.0
    assert np.ptp(angle[:500]) > 0.0
    assert angle[751] != angle[750]
    command = "lever" if actuator == "collective" else "stick"
    assert np.ptp(rows[500:751, getattr(COLUMN, command)]) > 0.0


@pytest.mark.parametrize("bias_kt", [-8.0, 8.0])
def test_a_biased_airspeed_is_what_pilot_and_laws_fly_by(bias_kt):
    """The pilot settles the indication on its reference, so the true airspeed ends off by the bias; truth is judged."""
    simulation = Simulation(hold(80.0, 75.0, faults=(Fault(kind="airspeed-bias", start=2.0, bias=kt(bias_kt)),)))
    rows = simulation.run(250 * 60)
    assert rows[500, COLUMN.airspeed_indicated_kt] - rows[500, COLUMN.airspeed_kt] == pytest.approx(bias_kt)
    assert rows[-1, COLUMN.airspeed_indicated_kt] == pytest.approx(80.0, abs=0.3)
    assert rows[-1, COLUMN.airspeed_kt] == pytest.approx(80.0 - bias_kt, abs=0.3)
    assert rows[-1, COLUMN.altitude_m] == pytest.approx(100.0, abs=1.0)
    sensors, margins = simulation.sensors(), simulation.margins()
    row = simulation.step()
    assert sensors.airspeed == pytest.approx(kt(float(row[COLUMN.airspeed_indicated_kt])))
    assert margins.low == pytest.approx(kt(float(row[COLUMN.margin_low_kt] + bias_kt)))


def test_a_frozen_airspeed_stands_still():
    rows = Simulation(conversion(faults=(Fault(kind="airspeed-frozen", start=3.0, end=4.0),))).run(1250)
    shown, true = rows[:, COLUMN.airspeed_indicated_kt], rows[:, COLUMN.airspeed_kt]
    assert np.ptp(shown[750:1000]) < 1e-9
    assert shown[750] == pytest.approx(true[750])
    assert true[999] - true[750] > 1.0
    np.testing.assert_array_equal(shown[1000:], true[1000:])


@pytest.mark.parametrize("plant", PLANTS)
def test_one_engine_does_not_hold_the_hover(plant):
    """At 13 000 lb hover asks for more than one engine's contingency rating: power is held, the aircraft sinks."""
    fault = Fault(kind="engine-limit", start=1.0, power=0.0)
    rows = Simulation(hold(0.0, 90.0, plant=plant, faults=(fault,))).run(250 * 8)
    power = rows[:, COLUMN.engine_power_shp]
    assert power[249] > 1802.0 * 1.02
    assert power[250 * 3 :].max() < 1802.0 * 1.01
    assert rows[-1, COLUMN.climb_rate_m_s] < -0.3
    assert rows[-1, COLUMN.lever] > rows[0, COLUMN.lever]  # the pilot pulls in vain


def test_a_live_failure_acts_in_the_frame_that_starts():
    fault = Fault(kind="nacelle-jammed", start=999.0)
    scheduled = Simulation(conversion(faults=(Fault(kind="nacelle-jammed", start=2.0, end=3.0),))).run(1000)
    simulation = Simulation(conversion())
    pieces = [simulation.run(500)]
    simulation.disturb(FaultSwitch(fault, on=True))
    pieces.append(simulation.run(250))
    simulation.sensors()
    simulation.disturb(FaultSwitch(fault, on=False))
    pieces.append(simulation.run(250))
    assert history_sha256(pieces) == history_sha256([scheduled])


SCENARIO = """
format = 1
name = "rough"
title = "A rough flight"
duration_s = 4.0
[start]
airspeed_kt = 80
nacelle_deg = 75
[flight]
heading_deg = 120
wind_kt = 12
wind_from_deg = 200
wind_reference_height_m = 10
[air]
turbulence = "moderate"
lateral = true
fade_in_s = 0.5
[[air.gusts]]
time_s = 1.0
below_kt = 6
lateral_kt = 5
length_m = 80
[[air.gusts]]
time_s = 2.0
ahead_kt = -5
duration_s = 0
shape = "ramp"
[[faults]]
kind = "actuator-slow"
actuator = "cyclic"
time_s = 1.0
end_s = 2.5
rate_deg_s = 1.5
[[faults]]
kind = "engine-limit"
time_s = 3.0
power_shp = 0
other_engine = "takeoff"
"""


def test_scenario_to_log_to_replay(tmp_path):
    """A file with air and failures, live ones on top: events recorded, the log replays to the same hash."""
    from rtsim.atmosphere.specification import Gust, Turbulence
    from scenarios import fly
    from scenarios.files.loader import parse_scenario
    from scenarios.flight.replay import replay_log
    from scenarios.flight.runner import FlightOutputs

    scenario, problems = parse_scenario(SCENARIO, file="rough.toml")
    assert problems == []
    control = FlightControl()
    control.disturb(Gust(start=0.0, below=3.0, duration=0.5))
    control.disturb(Turbulence.of_severity("light"))
    control.disturb(FaultSwitch(Fault(kind="airspeed-bias", start=0.0, bias=kt(3.0)), on=True))
    for _ in range(9):
        control.disturb(Gust(start=0.0, below=0.1, duration=3.0, shape="build-up"))
    path = tmp_path / "rough.parquet"
    record = fly(scenario, speed="max", control=control, outputs=FlightOutputs(log=path))
    assert record.completed
    events = [(event.kind, event.frame) for event in record.events]
    assert events[:3] == [("gust", 0), ("turbulence", 0), ("failure", 0)]
    assert [event for event in events if event[0] == "refused"] == [("refused", 0)] * 2
    told = [(event.text, event.frame) for event in record.events if event.kind == "scheduled_failure"]
    assert told == [("failure: cyclic slow", 250), ("mended: cyclic slow", 625), ("failure: engine limit", 750)]
    gust = record.rows[:, COLUMN.gust_w_m_s]
    assert np.ptp(gust) > kt(4.0)
    assert np.ptp(record.rows[:, COLUMN.gust_v_m_s]) > kt(4.0)
    assert record.rows[:, COLUMN.gust_r_deg_s].any()
    wind = record.rows[0, [COLUMN.wind_north_m_s, COLUMN.wind_east_m_s]]
    assert np.degrees(np.arctan2(-wind[1], -wind[0])) % 360.0 == pytest.approx(200.0)
    assert np.hypot(*wind) > kt(12.0)  # at 100 m, given at 10 m
    result = replay_log(path)
    assert result.same, result.difference


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"moderate"', '"wild"', ["air.turbulence", "none, light, moderate, severe"]),
        ("fade_in_s = 0.5", "wind_at_20_ft_kt = 20", ["air.turbulence: is given twice", "delete wind_at_20_ft_kt"]),
        ("fade_in_s = 0.5", "fade_in_s = 99", ["air.fade_in_s: is out of range", "0 to 60"]),
        ("below_kt = 6", "below_kt = 66", ["air.gusts[0].below_kt: is out of range", "-60 to 60"]),
        ("lateral_kt = 5", "lateral_kt = 66", ["air.gusts[0].lateral_kt: is out of range", "-60 to 60"]),
        ("lateral = true", 'lateral = "left"', ["air.lateral"]),
        ("wind_from_deg = 200", "wind_from_deg = 400", ["flight.wind_from_deg: is out of range", "0 to 360"]),
        ("wind_reference_height_m = 10", "wind_reference_height_m = 0", ["flight.wind_reference_height_m", "1 to 300"]),
        ("length_m = 80\n", "", ["air.gusts[0]: needs either a duration or a length", "duration_s or length_m"]),
        ("length_m = 80", "length_m = 0", ["air.gusts[0].length_m: is out of range", "got 0"]),
        ("length_m = 80", "span = 80", ["air.gusts[0].span: is not a known key"]),
        ('shape = "ramp"', 'shape = "step"', ["air.gusts[1].shape", "one-minus-cosine, build-up, ramp"]),
        ('actuator = "cyclic"', "", ["faults[0].actuator: is missing for actuator-slow", "add it"]),
        ("rate_deg_s = 1.5", "", ["faults[0].rate_deg_s: is missing for actuator-slow"]),
        ("rate_deg_s = 1.5", "rate_deg_s = -1", ["faults[0].rate_deg_s: is out of range", "0 to 200"]),
        ("rate_deg_s = 1.5", 'rate_deg_s = 1.5\nstop = "low"', ["faults[0].stop: has no meaning for actuator-slow"]),
        ("end_s = 2.5", "end_s = 0.5", ["faults[0].end_s: is not after start", "got 0.5"]),
        ('kind = "engine-limit"', 'kind = "engine"', ["faults[1].kind", "engine-limit"]),
        ("power_shp = 0", "power_shp = 9999", ["faults[1].power_shp: is out of range", "0 to 1802"]),
        ("power_shp = 0", "bias_kt = 3", ["faults[1].bias_kt: has no meaning for engine-limit", "leave it out"]),
        ("power_shp = 0\n", "", ["faults[1].power_shp: is missing for engine-limit"]),
    ],
)
def test_mistakes_in_air_and_failures_name_key_value_and_mend(old, new, words):
    from scenarios.files.loader import parse_scenario

    assert old in SCENARIO
    scenario, problems = parse_scenario(SCENARIO.replace(old, new, 1), file="rough.toml")
    assert scenario is None
    text = " | ".join(str(problem) for problem in problems)
    assert text.startswith("rough.toml: ")
    for word in words:
        assert word in text


def test_reading_a_scenario_with_failures_loads_no_compiled_code():
    import subprocess
    import sys

    code = (
        "import sys\nfrom scenarios.files.loader import parse_scenario\n"
        f"scenario, problems = parse_scenario({SCENARIO!r}, file='x')\n"
        "assert scenario is not None and len(scenario.faults) == 2, problems\nassert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
