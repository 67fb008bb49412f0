"""The condition of an aircraft: what it is, what follows from it, and where its database is kept."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.aircraft.condition import SHIPPED, AircraftCondition
from rtsim.aircraft.points import Condition
from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.xv15.dynamics_kernels import gravity_centre
from rtsim.aircraft.xv15.model import Xv15
from rtsim.corridor.boundaries import load_corridor
from rtsim.errors import InputError
from rtsim.loop import aircraft as flown_aircraft
from rtsim.loop.options import CONDITION, FlightOptions, declared
from rtsim.lpv.building.xv15_grid import Xv15Grid
from rtsim.lpv.database import Database
from rtsim.lpv.files import kept_databases
from rtsim.lpv.files.storage import load_database
from rtsim.protection.boundary import load_boundary
from rtsim.systems.ground import load_ground_tables
from rtsim.systems.ground_kernels import FORWARD
from rtsim.units import FOOT, INCH, POUND, POUND_FORCE, deg, kt

LIGHT_AND_HIGH = AircraftCondition(mass=11000.0 * POUND, density_altitude=4000.0 * FOOT, cg_forward=3.0 * INCH)
HOVER = Condition(airspeed=0.0, nacelle_angle=math.pi / 2.0)


@given(weight=st.floats(9000.0, 15000.0), height=st.floats(-2000.0, 15000.0), forward=st.floats(0.0, 9.4))
def test_a_condition_that_was_written_and_read_is_the_same(weight, height, forward):
    condition = AircraftCondition(mass=weight * POUND, density_altitude=height * FOOT, cg_forward=forward * INCH)
    options = FlightOptions(
        mass=condition.mass, density_altitude=condition.density_altitude, cg_forward=condition.cg_forward
    )
    again = {name: declared()[name].inside(options.shown()[declared()[name].key]) for name in CONDITION}
    assert FlightOptions(**again).condition == condition
    assert AircraftCondition.stored(condition.attributes) == condition
    assert kept_databases._name(AircraftCondition.stored(condition.attributes)) == kept_databases._name(condition)


def test_given_defaults_are_the_shipped_aircraft():
    given_lb = FlightOptions(mass=declared()["mass"].inside(13000.0), density_altitude=0.0, cg_forward=0.0)
    assert given_lb.aircraft == FlightOptions().aircraft == ""
    assert AircraftCondition.stored(load_database().attributes) == SHIPPED
    assert Xv15.under(SHIPPED).tables is Xv15.load().tables
    assert load_database(SHIPPED) is load_database()
    np.testing.assert_array_equal(load_boundary("design", load_database()).low.speed, load_corridor("design").low.speed)


def test_a_condition_and_a_database_of_ones_own_contradict_each_other():
    options = FlightOptions(database="own.nc", mass=LIGHT_AND_HIGH.mass)
    with pytest.raises(InputError, match="cannot be flown with a database of its own"):
        _ = options.aircraft


@pytest.mark.parametrize(("name", "shown"), [("mass", 8999.0), ("density_altitude", 15001.0), ("cg_forward", 9.5)])
def test_out_of_range_is_one_sentence(name, shown):
    item = declared()[name]
    with pytest.raises(InputError, match=rf"{item.flag}: is out of range .*allowed: "):
        FlightOptions().changed({name: item.inside(shown)})


def test_the_nonlinear_aircraft_has_the_weight_the_air_and_the_centre_of_gravity():
    usual, other = Xv15.load(), Xv15.under(LIGHT_AND_HIGH)
    assert other.tables.configuration.mass == LIGHT_AND_HIGH.mass
    # ISA at 4000 ft: 1.0879 kg/m^3, 335.6 m/s (ICAO Doc 7488)
    np.testing.assert_allclose(other.tables.configuration.density, 1.0879, rtol=1e-4)
    np.testing.assert_allclose(other.tables.configuration.sound_speed, 335.6, rtol=1e-3)
    upright = [np.array(gravity_centre(aircraft.tables.mass, deg(90.0))) for aircraft in (usual, other)]
    np.testing.assert_allclose(upright[1] - upright[0], [-3.0 * INCH, 0.0], atol=1e-9)
    # the pylons weigh the same, so that the lighter aircraft's centre of gravity travels further
    travel = [
        np.array(gravity_centre(aircraft.tables.mass, 0.0)) - place
        for aircraft, place in zip((usual, other), upright, strict=True)
    ]
    np.testing.assert_allclose(travel[1], travel[0] * 13.0 / 11.0, rtol=1e-9)
    assert other.tables.mass.pitch_inertia_slope == usual.tables.mass.pitch_inertia_slope


def test_hover_at_the_condition_balances():
    """The rotors carry the weight (and the download), the stick the offset, with more collective in thinner air."""
    usual = Xv15.load().trim(HOVER)
    lighter = Xv15.under(replace(SHIPPED, mass=LIGHT_AND_HIGH.mass)).trim(HOVER)
    higher = Xv15.under(replace(SHIPPED, density_altitude=LIGHT_AND_HIGH.density_altitude)).trim(HOVER)
    forward = Xv15.under(replace(SHIPPED, cg_forward=LIGHT_AND_HIGH.cg_forward)).trim(HOVER)
    assert all(point.converged for point in (usual, lighter, higher, forward))
    np.testing.assert_allclose(lighter.y[0] / usual.y[0], 11.0 / 13.0, rtol=3e-3)
    assert 2.0 * lighter.y[0] / POUND_FORCE > 11000.0
    np.testing.assert_allclose(higher.y[0], usual.y[0], rtol=3e-3)
    assert higher.u[1] > usual.u[1] + 0.04
    assert forward.u[0] < usual.u[0] - 0.1  # aft stick
    own = Xv15.under(LIGHT_AND_HIGH).trim(HOVER)
    explicit = Xv15.load({"cg.heli_SL_in": 298.2}).trim(
        replace(HOVER, mass=LIGHT_AND_HIGH.mass, pressure_altitude=LIGHT_AND_HIGH.density_altitude)
    )
    np.testing.assert_allclose(own.x, explicit.x, atol=2e-4)  # nacelles up, the pylons' travel is nothing


def test_corridor_is_in_true_airspeed_of_the_air():
    database = replace(load_database(), attributes={**load_database().attributes, **LIGHT_AND_HIGH.attributes})
    chart, flown = load_corridor("flight"), load_boundary("flight", database)
    ratio = math.sqrt(1.225 / 1.0879)
    np.testing.assert_allclose(flown.low.speed, chart.low.speed * ratio, rtol=1e-4)
    np.testing.assert_allclose(flown.high_speed(0.0), chart.high_speed(0.0) * ratio, rtol=1e-4)
    assert flown.margins(kt(100.0), deg(60.0)).low < chart.margins(kt(100.0), deg(60.0)).low


def test_kept_database_is_named_by_condition_and_by_what_it_is_built_from(tmp_path, monkeypatch):
    own = SimpleNamespace(main_folder=lambda: tmp_path, writable_folder=lambda: tmp_path)
    monkeypatch.setattr(kept_databases, "store", own)
    place = kept_databases.place_for(LIGHT_AND_HIGH)
    assert place.name.startswith("xv15_11000lb_4000ft_3in_")
    assert kept_databases.kept_file(LIGHT_AND_HIGH) is None
    with pytest.raises(InputError, match=r"is not built yet; run 'rtsim model build --weight-lb 11000 "):
        load_database(LIGHT_AND_HIGH)
    place.write_bytes(b"")
    assert kept_databases.kept_file(LIGHT_AND_HIGH) == place
    names = {kept_databases.place_for(replace(LIGHT_AND_HIGH, **{name: 1.0})) for name in CONDITION}
    assert len(names | {place}) == 4
    monkeypatch.setattr(kept_databases, "_recipe", lambda: "0123456789abcdef")
    assert kept_databases.kept_file(LIGHT_AND_HIGH) is None


def test_one_builds_while_the_other_waits(tmp_path, monkeypatch, toy):
    """Two flights of one condition at once: one build, and both get its database."""
    own = SimpleNamespace(main_folder=lambda: tmp_path, writable_folder=lambda: tmp_path)
    monkeypatch.setattr(kept_databases, "store", own)
    builds, begun, waiting = [], threading.Event(), threading.Event()

    def build(condition: AircraftCondition, **_: object) -> Database:
        builds.append(condition)
        begun.set()
        assert waiting.wait(30.0)
        return toy

    monkeypatch.setattr("rtsim.pilot.database.build_xv15", build)
    said: list[str] = []

    def listen(words: str, share: float | None) -> None:
        assert share is None
        said.append(words)
        if "waiting" in words:
            waiting.set()

    found: list[str] = []
    flights = [
        threading.Thread(target=lambda: found.append(flown_aircraft.database_of(LIGHT_AND_HIGH).content_hash))
        for _ in range(2)
    ]
    with flown_aircraft.told(listen):
        flights[0].start()
        assert begun.wait(30.0)
        flights[1].start()
        for flight in flights:
            flight.join(30.0)
    assert builds == [LIGHT_AND_HIGH]
    assert found == [toy.content_hash] * 2
    assert [words.split()[0] for words in said] == ["Building", "Another"]
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".lock", ".nc"]


def test_what_is_damaged_or_broken_off_is_built_anew(tmp_path, monkeypatch, toy, caplog):
    own = SimpleNamespace(main_folder=lambda: tmp_path, writable_folder=lambda: tmp_path)
    monkeypatch.setattr(kept_databases, "store", own)

    def interrupted(*_: object, **__: object) -> Database:
        raise KeyboardInterrupt

    monkeypatch.setattr("rtsim.pilot.database.build_xv15", interrupted)
    with pytest.raises(KeyboardInterrupt):
        flown_aircraft.database_of(LIGHT_AND_HIGH)
    assert [path.suffix for path in tmp_path.iterdir()] == [".lock"]
    kept_databases.place_for(LIGHT_AND_HIGH).write_bytes(b"half of it")
    monkeypatch.setattr("rtsim.pilot.database.build_xv15", lambda *_, **__: toy)
    assert flown_aircraft.database_of(LIGHT_AND_HIGH).content_hash == toy.content_hash
    assert "It is built anew." in caplog.text


@pytest.fixture
def toy() -> Database:
    """A small piece of the shipped database, as if built at the condition."""
    shipped = load_database()
    speeds, angles = slice(2, 8), slice(-3, None)
    arrays = ("x_ref", "u_ref", "y_ref", "xdot_ref", "A", "B", "C", "D", "df_dnacelle", "valid")
    return replace(
        shipped,
        airspeed=shipped.airspeed[speeds],
        nacelle=shipped.nacelle[angles],
        rotor_speed=shipped.rotor_speed[angles],
        flap=shipped.flap[speeds, angles],
        attributes={**shipped.attributes, **LIGHT_AND_HIGH.attributes},
        pilot={},
        lateral=None,
        **{name: getattr(shipped, name)[:, speeds, angles] for name in arrays},
    )


def test_the_weight_stands_on_the_wheels():
    usual, other = (load_ground_tables(xv15_profile(), Xv15.under(c).tables) for c in (SHIPPED, LIGHT_AND_HIGH))
    assert other.mass == LIGHT_AND_HIGH.mass
    np.testing.assert_allclose(other.wheels[:, FORWARD] - usual.wheels[:, FORWARD], -3.0 * INCH, atol=1e-9)
    np.testing.assert_allclose(other.wheels[:, 2].sum() / usual.wheels[:, 2].sum(), 11.0 / 13.0, rtol=0.02)
    assert other.wheels[0, 2] / other.wheels[1, 2] > usual.wheels[0, 2] / usual.wheels[1, 2]  # more on the nose


def test_grid_says_its_condition():
    attributes = Xv15Grid.under(LIGHT_AND_HIGH).attributes
    assert (attributes["weight_lb"], attributes["density_altitude_ft"], attributes["cg_in"]) == (11000.0, 4000.0, 3.0)
    np.testing.assert_allclose(attributes["air_density_kg_m3"], LIGHT_AND_HIGH.density)
    assert AircraftCondition.stored(Xv15Grid().attributes) == SHIPPED
