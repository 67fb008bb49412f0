"""Engines and fuel: the published nodes, what is inferred between and beyond them, and what a frame burns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.atmosphere import standard_atmosphere
from rtsim.aircraft.profile import parse_profile, xv15_profile
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError
from rtsim.kernels.compiled import interpreted
from rtsim.systems import engine_kernels as kernels
from rtsim.systems.engine import fuel_flow, load_engine_tables, power_available
from rtsim.units import FOOT, HORSEPOWER, POUND_FORCE, rpm

LB_H = POUND_FORCE / 3600.0
ALTITUDE_FT = [0.0, 4000.0, 8000.0, 12000.0, 16000.0, 20000.0]
TAKEOFF_SHP = [1374.0, 1285.0, 1181.0, 1061.0, 942.0, 788.0]
CARPET = {  # TM X-62407 figure 6.2.7 as read: lb/h of one engine at 200, 400, ... shp
    0.0: [362.0, 451.0, 543.0, 640.0, 724.0, 808.0],
    8000.0: [288.0, 380.0, 468.0, 556.0, 645.0],
    20000.0: [208.0, 298.0, 387.0, 478.0],
}


def one_engine_lb_h(shp, altitude_ft):
    return fuel_flow(2.0 * shp * HORSEPOWER, altitude_ft * FOOT) / 2.0 / LB_H


@pytest.mark.parametrize(("altitude_ft", "shp"), list(zip(ALTITUDE_FT, TAKEOFF_SHP, strict=True)))
def test_takeoff_power_is_the_published_one_and_near_a_power_of_the_density(altitude_ft, shp):
    """TM X-62407 figure 6.2.2; the printed rule is within 6 %."""
    got = power_available("takeoff", altitude_ft * FOOT) / 2.0 / HORSEPOWER
    assert got == pytest.approx(shp, rel=1e-12)
    ratio = standard_atmosphere(altitude_ft * FOOT)[0] / standard_atmosphere(0.0)[0]
    assert got == pytest.approx(1374.0 * ratio**0.80, rel=0.06)


@pytest.mark.parametrize("altitude_ft", list(CARPET))
def test_fuel_flow_is_the_published_carpet(altitude_ft):
    for place, flow in enumerate(CARPET[altitude_ft]):
        assert one_engine_lb_h(200.0 * (place + 1), altitude_ft) == pytest.approx(flow, rel=1e-12)


def test_fuel_flow_of_the_published_hover_and_beyond_the_carpet():
    """884 shp an engine burn 677 lb/h (reading 6); beyond its rows and below 200 shp the carpet has the law's slope."""
    assert one_engine_lb_h(884.0, 0.0) == pytest.approx(677.0, abs=6.0)
    assert one_engine_lb_h(1374.0, 0.0) == pytest.approx(895.0, rel=0.02)  # printed at take-off power
    assert one_engine_lb_h(1600.0, 0.0) == pytest.approx(808.0 + 400.0 * 0.448)
    assert one_engine_lb_h(1200.0, 20000.0) == pytest.approx(478.0 + 400.0 * 0.448)
    assert one_engine_lb_h(0.0, 0.0) == pytest.approx(362.0 - 200.0 * 0.448)
    assert one_engine_lb_h(-300.0, 0.0) == one_engine_lb_h(0.0, 0.0)


@given(altitude=st.floats(-1000.0, 10900.0), further=st.floats(1.0, 2000.0))
def test_power_falls_with_altitude_and_warmth_and_rises_with_the_rating(altitude, further):
    here = power_available("takeoff", altitude)
    assert power_available("takeoff", min(altitude + further, 10950.0)) < here
    assert power_available("takeoff", altitude, 15.0) < here < power_available("takeoff", altitude, -15.0)
    ratings = [power_available(rating, altitude) for rating in ("normal", "military", "takeoff", "contingency")]
    assert ratings == sorted(ratings)
    assert ratings[3] / ratings[2] == pytest.approx(1802.0 / 1550.0)


@given(shp=st.floats(0.0, 2200.0), more=st.floats(1.0, 100.0), altitude_ft=st.floats(0.0, 20000.0))
def test_fuel_flow_rises_with_power_and_falls_with_altitude(shp, more, altitude_ft):
    here = one_engine_lb_h(shp, altitude_ft)
    assert one_engine_lb_h(shp + more, altitude_ft) > here
    assert one_engine_lb_h(shp, min(altitude_ft + 500.0, 20000.0)) <= here


def test_temperature_is_bounded():
    with pytest.raises(InputError, match="temperature offset"):
        power_available("takeoff", 0.0, 100.0)


def test_blades_are_those_of_the_nonlinear_model():
    tables, rotor = load_engine_tables(), Xv15.load().tables.rotor
    assert tables.radius == pytest.approx(rotor.radius)
    chord = 14.0 / 12.0 * FOOT
    assert tables.disc / standard_atmosphere(0.0)[0] == pytest.approx(3.0 * chord * rotor.radius, rel=2e-3)
    speed, thrust = rpm(589.0), 6500.0 * POUND_FORCE
    got = interpreted(kernels.thrust_over_solidity)(tables, thrust, speed)
    assert got == pytest.approx(thrust / (1.225 * 3.0 * chord * rotor.radius * (speed * rotor.radius) ** 2), rel=2e-3)
    assert load_engine_tables(density=standard_atmosphere(1200.0)[0]).ground == pytest.approx(1200.0, abs=1.0)


@given(fuel=st.floats(0.001, 50.0), flow=st.floats(0.0, 2000.0))
def test_what_is_burned_is_gone_and_tanks_hold_no_less_than_nothing(fuel, flow):
    tank = np.array([fuel, 100.0])
    out = interpreted(kernels.burn)(tank, flow, 0.004)
    assert tank[kernels.TANK.fuel] == max(fuel - 0.004 * flow, 0.0)
    assert out == (tank[kernels.TANK.fuel] == 0.0)


def test_fuel_that_nobody_stated_never_ends():
    tank = np.zeros(kernels.TANK.size)
    assert not interpreted(kernels.burn)(tank, 5.0, 0.004)


def test_a_profile_without_lapse_and_fuel_has_the_rule_of_density_and_no_fuel(tmp_path):
    own = parse_profile(
        'name = "other"\nborrows = ["nacelle", "corridor", "protection", "controls", "pilot", "aids"]\n'
        "[dimensions]\nspan_ft = 30.0\n[systems.engine]\nengines = 2\ntakeoff_shp = 100.0\n"
        "transmission_efficiency = 0.9\n",
        file=str(tmp_path / "own.profile.toml"),
    )
    tables = load_engine_tables(own)
    ratio = standard_atmosphere(8000.0 * FOOT)[0] / standard_atmosphere(0.0)[0]
    assert power_available("takeoff", 0.0, profile=own) == pytest.approx(180.0 * HORSEPOWER)
    assert power_available("takeoff", 8000.0 * FOOT, profile=own) == pytest.approx(180.0 * HORSEPOWER * ratio**0.8)
    assert tables.capacity == 0.0
    assert fuel_flow(100.0 * HORSEPOWER, 0.0, profile=own) == 0.0
    assert interpreted(kernels.thrust_over_solidity)(tables, 1000.0, 60.0) == 0.0


def test_the_profile_joins_the_files_of_a_part():
    systems = xv15_profile().systems
    assert systems.file == "xv15/data/systems.toml, engine.toml"
    assert systems.table("fuel").number("capacity_lb") == 1490.0
    assert systems.table("engine").number("takeoff_shp") == 1550.0
    assert {"GTRS", "FAMILIARIZATION", "DESIGN"} <= set(systems.table("sources").data)


@pytest.mark.parametrize(("table", "key"), [
    ("[systems.fuel]\ncapacity_lb = 100.0\naltitude_ft = [0.0]\n", "altitude_ft"),
    ("[systems.engine.lapse]\naltitude_ft = [0.0, 1.0]\ntakeoff_shaft_shp = [1.0]\n", "takeoff_shaft_shp"),
    ("[dimensions]\nrotor_solidity = 0.1\n", "rotor_radius_ft"),
])  # fmt: skip
def test_a_profile_that_says_half_of_it_is_refused_by_its_key(table, key, tmp_path):
    text = 'name = "other"\nborrows = ["nacelle", "corridor", "protection", "controls", "pilot", "aids"]\n'
    text += "" if "dimensions" in table else "[dimensions]\n"
    text += "[systems.engine]\nengines = 2\ntakeoff_shp = 100.0\ntransmission_efficiency = 0.9\n"
    with pytest.raises(InputError, match=key):
        load_engine_tables(parse_profile(text + table, file=str(tmp_path / "own.profile.toml")))
