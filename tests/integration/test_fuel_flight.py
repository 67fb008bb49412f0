"""Fuel in flight: what is burned is gone, the last drop stops the engines for good, and a replay knows it all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenarios
from rtsim.errors import InputError
from rtsim.faults.fault import Fault
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.systems.engine import power_available
from rtsim.units import HORSEPOWER, POUND_FORCE, deg, kt, rpm
from scenarios.files.options import Overrides
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs

ENGINES_STOPPED = 64.0


def hover(**changes):
    programme = Programme.hold(airspeed=0.0, nacelle_angle=deg(90.0), altitude=100.0)
    return FlightSetup(programme=programme, faults=changes.pop("faults", ())).with_options(**changes)


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_the_fuel_that_is_left_is_what_was_not_burned(plant):
    simulation = Simulation(hover(plant=plant))
    rows = simulation.run(500)
    fuel, flow = rows[:, COLUMN.fuel_lb], rows[:, COLUMN.fuel_flow_lb_h]
    assert fuel[0] == pytest.approx(1490.0)
    assert fuel[0] - fuel[-1] == pytest.approx(flow[:-1].sum() * simulation.dt / 3600.0, rel=1e-6)
    assert flow[0] == pytest.approx(2.0 * (273.0 + 0.448 * rows[0, COLUMN.power_shp] / 2.0), abs=2.0 * 8.0)


def test_signals_of_the_rotor_are_what_they_say():
    programme = Programme.hold(airspeed=kt(60.0), nacelle_angle=deg(75.0), altitude=500.0)
    row = Simulation(FlightSetup(programme=programme)).step()
    tip = rpm(589.0) * 12.5 * 0.3048
    angle, u, w = deg(row[COLUMN.nacelle_deg]), row[COLUMN.body_u_m_s], row[COLUMN.body_w_m_s]
    assert row[COLUMN.advance_ratio] == pytest.approx((u * np.sin(angle) + w * np.cos(angle)) / tip)
    blades = 0.089 * np.pi * (12.5 * 0.3048) ** 2
    loaded = row[COLUMN.thrust_per_rotor_lb] * POUND_FORCE / (1.225 * blades * tip**2)
    assert row[COLUMN.thrust_coefficient_over_solidity] == pytest.approx(loaded, rel=1e-3)
    available = power_available("takeoff", 500.0) / 0.93 / HORSEPOWER
    assert row[COLUMN.engine_power_available_shp] == pytest.approx(available, rel=1e-4)


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_without_fuel_both_engines_stop_and_nothing_mends_them(plant):
    mending = Fault(kind="engine-limit", start=0.2, end=1.5, power=800.0 * HORSEPOWER)
    simulation = Simulation(hover(plant=plant, fuel=0.4 * POUND_FORCE, faults=(mending,)))
    rows = simulation.run(750)
    dry = int(np.argmin(rows[:, COLUMN.fuel_lb]))
    assert 250 < dry < 300
    assert np.all(rows[dry:, COLUMN.fuel_lb] == 0.0)
    assert np.all(rows[dry:, COLUMN.fuel_flow_lb_h] == 0.0)
    assert np.all(rows[dry:, COLUMN.engine_power_available_shp] == 0.0)
    assert np.all(rows[dry:, COLUMN.failures] == ENGINES_STOPPED)
    assert rows[-1, COLUMN.engine_power_shp] < 0.3 * rows[0, COLUMN.engine_power_shp]
    assert rows[-1, COLUMN.climb_rate_m_s] < -5.0


def test_the_last_drop_is_an_event_and_a_replay_burns_the_same(tmp_path: Path):
    overrides = Overrides(duration=2.0, fuel=0.4 * POUND_FORCE)
    log = tmp_path / "dry.parquet"
    flight = scenarios.fly("hover", speed="max", overrides=overrides, outputs=FlightOutputs(log=log))
    told = [event for event in flight.events if event.kind == "fuel"]
    assert [event.text for event in told] == ["the fuel is used up: the engines stop"]
    assert flight["fuel_lb"][told[0].frame] == 0.0 < flight["fuel_lb"][told[0].frame - 1]
    assert flight.summary()["fuel_lb"]["used"] == pytest.approx(0.4, abs=0.002)
    assert flight.summary()["options"]["fuel_lb"] == pytest.approx(0.4)
    assert replay_log(log).replayed_sha256 == flight.history_sha256


def test_snapshots_and_resets_know_the_fuel():
    simulation = Simulation(hover(fuel=100.0 * POUND_FORCE))
    simulation.run(100)
    snapshot = simulation.snapshot()
    first = simulation.run(100)
    simulation.restore(snapshot)
    assert np.array_equal(simulation.run(100), first)
    simulation.reset()
    assert simulation.step()[COLUMN.fuel_lb] == pytest.approx(100.0)


def test_more_than_the_tanks_hold_is_refused():
    with pytest.raises(InputError, match=r"--fuel-lb.*more than the tanks hold|more than the tanks hold.*--fuel-lb"):
        Simulation(hover(fuel=1600.0 * POUND_FORCE))
