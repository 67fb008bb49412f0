"""Gusts and turbulence in the closed loop: what is felt, what is shown, and one history however it is flown."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.atmosphere.specification import AirSpecification, Gust, Turbulence
from rtsim.command import Command
from rtsim.errors import InputError
from rtsim.frame import COLUMN, history_sha256
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.units import deg, kt, to_kt

MODERATE = AirSpecification(
    turbulence=Turbulence.of_severity("moderate"), gusts=(Gust(start=1.5, below=3.0, length=60.0),)
)


def hold(airspeed, nacelle, *, altitude=100.0, **changes):
    programme = Programme.hold(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), altitude=altitude)
    air = changes.pop("air", AirSpecification())
    return FlightSetup(programme=programme, air=air).with_options(**changes)


def flown(simulation, frames):
    return np.array([simulation.step() for _ in range(frames)])


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_step_and_run_give_the_same_history(plant):
    setup = hold(80.0, 75.0, air=MODERATE, plant=plant, seed=3, pilot_noise=True)
    stepped = flown(Simulation(setup), 500)
    simulation = Simulation(setup)
    pieces = [simulation.run(123), flown(simulation, 77)]
    simulation.sensors()
    pieces.append(simulation.run(300))
    assert history_sha256([stepped]) == history_sha256(pieces)
    assert np.ptp(stepped[:, COLUMN.gust_w_m_s]) > 0.5


def test_snapshot_reset_and_warm_up_keep_the_turbulence():
    setup = hold(80.0, 75.0, air=MODERATE)
    first = Simulation(setup).run(800)
    simulation = Simulation(setup)
    simulation.warm_up()
    np.testing.assert_array_equal(simulation.run(300), first[:300])
    snapshot = simulation.snapshot()
    np.testing.assert_array_equal(simulation.run(500), first[300:])
    simulation.restore(snapshot)
    np.testing.assert_array_equal(simulation.run(500), first[300:])
    simulation.reset()
    np.testing.assert_array_equal(simulation.run(800), first)


def test_recorded_commands_fly_the_same_flight():
    setup = hold(80.0, 75.0, air=MODERATE)
    original = Simulation(setup).run(500)
    replay = Simulation(setup)
    rows = [replay.step(Command(*(float(row[column]) for column in PILOT_COLUMNS))) for row in original]
    assert history_sha256([np.array(rows)]) == history_sha256([original])


PILOT_COLUMNS = (COLUMN.pilot_stick, COLUMN.pilot_lever, COLUMN.pilot_nacelle_rate_rad_s)


def test_severity_none_is_bit_for_bit_calm():
    calm = Simulation(hold(80.0, 75.0, pilot_noise=True)).run(400)
    none = AirSpecification(turbulence=Turbulence.of_severity("none"), gusts=(Gust(start=0.0, duration=1.0),))
    still = Simulation(hold(80.0, 75.0, pilot_noise=True, air=none)).run(400)
    assert still.tobytes() == calm.tobytes()
    for name in ("gust_u_m_s", "gust_w_m_s", "gust_q_deg_s"):
        assert calm[:, getattr(COLUMN, name)].tobytes() == bytes(8 * 400)


def test_lateral_turbulence_comes_from_a_stream_of_its_own():
    """An aircraft it does not move meets the same air to the last bit; else it differs by seed, and is the same cut."""
    lateral = dataclasses.replace(MODERATE, lateral=True)
    plain, unmoved = (
        Simulation(hold(80.0, 75.0, air=air, seed=4, plant="lpv-plain")).run(600) for air in (MODERATE, lateral)
    )
    rough = Simulation(hold(80.0, 75.0, air=lateral, seed=4)).run(600)
    new = [COLUMN.gust_v_m_s, COLUMN.gust_p_deg_s, COLUMN.gust_r_deg_s]
    old = slice(0, COLUMN.bank_deg)
    assert plain[:, old].tobytes() == unmoved[:, old].tobytes()
    assert not plain[:, new].any()
    assert (np.ptp(rough[:, new], axis=0) > [0.5, 0.5, 0.2]).all()
    other = Simulation(hold(80.0, 75.0, air=lateral, seed=5)).run(600)
    assert abs(np.corrcoef(rough[:, new[0]], other[:, new[0]])[0, 1]) < 0.9
    simulation = Simulation(hold(80.0, 75.0, air=lateral, seed=4))
    simulation.run(123)
    snapshot = simulation.snapshot()
    np.testing.assert_array_equal(flown(simulation, 77), rough[123:200])
    simulation.restore(snapshot)
    np.testing.assert_array_equal(simulation.run(477), rough[123:])


def test_turbulence_that_begins_in_flight_is_lateral_where_the_air_is_said_to_be():
    simulation = Simulation(hold(80.0, 75.0, air=AirSpecification(lateral=True)))
    assert not simulation.run(50)[:, COLUMN.gust_v_m_s].any()
    simulation.disturb(Turbulence.of_severity("severe", fade_in=0.0))
    assert simulation.run(100)[5:, COLUMN.gust_p_deg_s].all()


def test_pilot_noise_and_turbulence_are_independent_streams():
    """Switching one on does not change the other's numbers; another seed changes both."""
    quiet = Simulation(hold(80.0, 75.0, air=MODERATE, seed=4)).run(250)
    noisy = Simulation(hold(80.0, 75.0, air=MODERATE, seed=4, pilot_noise=True)).run(250)
    other = Simulation(hold(80.0, 75.0, air=MODERATE, seed=5)).run(250)
    # The filters follow speed and height, which differ a little, so the gusts do too.
    assert noisy[:, COLUMN.gust_u_m_s] == pytest.approx(quiet[:, COLUMN.gust_u_m_s], abs=0.02)
    assert np.abs(other[:, COLUMN.gust_u_m_s] - quiet[:, COLUMN.gust_u_m_s]).max() > 0.3


@pytest.mark.parametrize("plant", ["lpv", "lpv-plain", "nonlinear"])
def test_what_a_gust_does_at_once(plant):
    """A sharp updraft lifts, a sharp headwind shows on the airspeed, and neither moves the inertial state."""
    cruise = hold(150.0, 0.0, plant=plant)
    calm = Simulation(cruise).run(130)
    up = AirSpecification(gusts=(Gust(start=0.5, below=3.0, duration=0.0, shape="ramp"),))
    row = Simulation(dataclasses.replace(cruise, air=up)).run(130)
    at = 125
    assert row[:at].tobytes() == calm[:at].tobytes()
    assert row[at, COLUMN.load_factor] - calm[at, COLUMN.load_factor] > 0.2
    assert row[at, COLUMN.airspeed_kt] == pytest.approx(calm[at, COLUMN.airspeed_kt], abs=1e-9)
    assert row[at, COLUMN.climb_rate_m_s] == calm[at, COLUMN.climb_rate_m_s]
    ahead = AirSpecification(gusts=(Gust(start=0.5, ahead=kt(10.0), duration=0.0, shape="ramp"),))
    row = Simulation(dataclasses.replace(cruise, air=ahead)).run(130)
    for name in ("airspeed_kt", "airspeed_indicated_kt"):
        column = getattr(COLUMN, name)
        assert row[at, column] - calm[at, column] == pytest.approx(10.0)
    assert row[at, COLUMN.margin_high_kt] - calm[at, COLUMN.margin_high_kt] == pytest.approx(-10.0)
    assert row[at, COLUMN.ground_speed_kt] == calm[at, COLUMN.ground_speed_kt]


@pytest.mark.parametrize(
    ("airspeed", "nacelle"), [(0.0, 90.0), (40.0, 85.0), (80.0, 75.0), (120.0, 50.0), (150.0, 0.0)]
)
@pytest.mark.parametrize("component", ["ahead", "below"])
@pytest.mark.parametrize("size", [3.0, -3.0])
def test_lpv_and_nonlinear_plant_answer_a_gust_alike(airspeed, nacelle, component, size):
    """Bands of LPV against nonlinear model as over Table 1 (0.5 m, 0.4 deg, 0.15 deg flapping), in a gust of 3 m/s.

    At 40 kn and 85 deg the tail's tables are so curved that gusts acting through constant matrices miss by 2 deg.
    """
    air = AirSpecification(gusts=(Gust(start=0.2, duration=1.0, **{component: size}),))
    lpv, nonlinear = (
        Simulation(hold(airspeed, nacelle, plant=plant, air=air)).run(500)
        - Simulation(hold(airspeed, nacelle, plant=plant)).run(500)
        for plant in ("lpv", "nonlinear")
    )
    bands = {"altitude_m": 0.5, "pitch_deg": 0.4, "longitudinal_flapping_deg": 0.15, "load_factor": 0.02}
    for name, band in bands.items():
        column = getattr(COLUMN, name)
        assert np.sqrt(np.mean((lpv - nonlinear)[:, column] ** 2)) < band, name
    # Each gust is felt: without one the comparison would say nothing.
    assert np.abs(nonlinear[:, [COLUMN.load_factor, COLUMN.pitch_deg]]).max() > 0.03


@pytest.mark.parametrize(
    ("airspeed", "nacelle", "height_band_m"), [(0.0, 90.0, 3.05), (80.0, 75.0, 6.1), (170.0, 0.0, 18.3)]
)
def test_the_pilot_holds_in_moderate_turbulence(airspeed, nacelle, height_band_m):
    """Pass bands of the pilot's reference (mocm_flight 6): 10 ft in hover, 60 ft in cruise, 5 kn of shown airspeed."""
    air = AirSpecification(turbulence=Turbulence.of_severity("moderate"))
    rows = Simulation(hold(airspeed, nacelle, air=air, seed=1)).run(250 * 60)
    assert len(rows) == 250 * 60
    assert np.abs(rows[:, COLUMN.altitude_m] - 100.0).max() < height_band_m
    shown = rows[:, COLUMN.airspeed_indicated_kt] - airspeed
    assert np.sqrt(np.mean(shown**2)) < 5.0
    assert np.abs(rows[:, COLUMN.gust_u_m_s]).max() > 1.5


def test_the_gusts_of_a_flight_have_the_intensity_of_its_height():
    """20 m above the ground, flown for 400 s: root mean square of what the plant was given."""
    air = AirSpecification(turbulence=Turbulence.of_severity("light", fade_in=0.0))
    rows = Simulation(hold(120.0, 50.0, altitude=20.0, air=air, seed=2)).run(100_000)
    assert len(rows) == 100_000
    sigma_w = 0.1 * 15.0
    height_ft = rows[:, COLUMN.altitude_m].mean() / 0.3048
    sigma_u = sigma_w / (0.177 + 0.000823 * height_ft) ** 0.4
    assert to_kt(float(rows[:, COLUMN.gust_w_m_s].std())) == pytest.approx(sigma_w, rel=0.1)
    assert to_kt(float(rows[:, COLUMN.gust_u_m_s].std())) == pytest.approx(sigma_u, rel=0.2)


def test_live_gusts_and_turbulence():
    simulation = Simulation(hold(80.0, 75.0))
    simulation.run(100)
    simulation.disturb(Gust(start=0.0, below=4.0, duration=0.0, shape="ramp"))
    rows = simulation.run(2)
    assert rows[0, COLUMN.gust_w_m_s] == 0.0
    assert rows[1, COLUMN.gust_w_m_s] == pytest.approx(4.0, rel=0.01)
    simulation.disturb(Turbulence.of_severity("severe", fade_in=1.0))
    before = simulation.snapshot()
    rows = simulation.run(500)
    assert np.ptp(rows[:, COLUMN.gust_u_m_s]) > 1.0
    simulation.restore(before)
    np.testing.assert_array_equal(flown(simulation, 500), rows)
    for _ in range(7):
        simulation.disturb(Gust(start=0.0, below=0.1, duration=1.0, shape="build-up"))
    with pytest.raises(InputError, match="no room"):
        simulation.disturb(Gust(start=0.0, below=0.1, duration=1.0))
