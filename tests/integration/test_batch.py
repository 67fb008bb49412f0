"""Compiled batches: equal to single flights bit for bit, whoever flies what and however many there are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.measures.figures import (
    OBJECTIVES,
    deviation_from_sums,
    figures_from_sums,
    figures_of_rows,
    objective_value,
)
from rtsim.measures.merit_kernels import MERIT_SIZE
from rtsim.measures.metrics import flight_metrics
from rtsim.optimization.batch import BatchFlight, BatchFlyer
from rtsim.optimization.paths import PATH_NAMES, paper_path
from rtsim.programme import Programme
from rtsim.units import deg, kt

PROGRAMMES = [paper_path(name, nacelle_rate_deg_s=8.0).programme() for name in PATH_NAMES]
CALM = FlightSetup(programme=PROGRAMMES[0])
ROUGH = FlightSetup(
    programme=PROGRAMMES[0], air=AirSpecification(turbulence=Turbulence.of_severity("moderate"))
).with_options(pilot_noise=True)


@pytest.fixture(scope="module", params=[CALM, ROUGH], ids=["calm", "turbulence and noise"])
def setup(request):
    return request.param.with_options(seed=3)


@pytest.fixture(scope="module")
def flown(setup):
    return BatchFlyer(setup, workers=1).fly(PROGRAMMES)


def test_a_batch_equals_single_flights_bit_for_bit(setup, flown):
    for programme, figures in zip(PROGRAMMES, flown, strict=True):
        simulation = Simulation(dataclasses.replace(setup, programme=programme))
        rows = simulation.run(figures.frames + 10)[: figures.frames]
        assert figures_of_rows(rows, simulation.dt) == figures
        assert figures.frames == np.ceil(programme.duration * 250 - 1e-6)


def test_a_batch_equals_the_metrics_of_rtsim_fly_bit_for_bit(setup, flown):
    for programme, figures in zip(PROGRAMMES, flown, strict=True):
        simulation = Simulation(dataclasses.replace(setup, programme=programme))
        metrics = flight_metrics(simulation.run(figures.frames), programme, simulation.dt)
        assert figures.flapping_integral_deg_s == metrics.flapping_deg.integral_deg_s
        assert figures.flapping_peak_deg == metrics.flapping_deg.peak
        assert figures.flapping_peak_time_s == metrics.flapping_deg.peak_time_s
        assert figures.flapping_rms_deg == metrics.flapping_deg.rms
        assert figures.stick.rms == metrics.stick.rms_in
        assert figures.stick.rms_rate == metrics.stick.rms_rate_in_s
        assert figures.stick.travel == metrics.stick.travel_in
        assert figures.lever.rms == metrics.lever.rms
        assert figures.lever.rms_rate == metrics.lever.rms_rate_per_s
        assert figures.lever.travel == metrics.lever.travel
        assert figures.worst_margin_kt == metrics.corridor.worst_margin_kt
        assert figures.time_outside_s == metrics.corridor.time_outside_s
        assert figures.altitude_deviation_m == metrics.altitude_m.max_deviation
        assert (figures.pitch_min_deg, figures.pitch_max_deg) == (metrics.pitch_deg.min, metrics.pitch_deg.max)
        assert figures.airspeed_rms_error_kt == metrics.airspeed_kt.rms_error
        assert figures.airspeed_max_error_kt == metrics.airspeed_kt.max_error
        assert figures.airspeed_final_kt == metrics.airspeed_kt.final
        assert figures.nacelle_max_rate_deg_s == metrics.nacelle_deg.max_rate_deg_s
        assert figures.controls_on_stop_frames == metrics.controls_on_stop_frames


def test_the_number_of_workers_changes_nothing(setup, flown):
    assert BatchFlyer(setup, workers=2).fly(PROGRAMMES) == flown
    assert BatchFlyer(setup, workers=3).fly(PROGRAMMES[::-1]) == flown[::-1]


def test_seeds_belong_to_flights():
    flyer = BatchFlyer(ROUGH, workers=2)
    flights = [BatchFlight(PROGRAMMES[0], seed, duration=5.0) for seed in (1, 2, 1)]
    first, second, again = flyer.fly(flights)
    assert first == again
    assert first != second
    assert first.frames == 1250


def test_figures_agree_with_plain_numpy(setup, flown):
    simulation = Simulation(dataclasses.replace(setup, programme=PROGRAMMES[0]))
    rows = simulation.run(flown[0].frames)
    figures = flown[0]
    flapping, stick = rows[:, COLUMN.flapping_deg], rows[:, COLUMN.stick] * 4.8
    assert figures.flapping_integral_deg_s == pytest.approx(flapping.sum() / 250.0, rel=1e-12)
    assert figures.flapping_rms_deg == pytest.approx(np.sqrt(np.mean(flapping**2)), rel=1e-12)
    assert figures.stick.rms == pytest.approx(stick.std(), rel=1e-9)
    assert figures.stick.rms_rate == pytest.approx((np.diff(stick) * 250.0).std(), rel=1e-9)
    assert figures.stick.path == pytest.approx(np.abs(np.diff(stick)).sum(), rel=1e-12)
    assert figures.stick.travel == np.ptp(stick)
    assert figures.lever.rms == pytest.approx(rows[:, COLUMN.lever].std(), rel=1e-9)
    assert figures.mean_margin_kt == pytest.approx(rows[:, COLUMN.margin_kt].mean(), rel=1e-12)
    power = rows[:, COLUMN.engine_power_shp]
    assert figures.energy_mj == pytest.approx(power.sum() / 250.0 * 745.69987e-6, rel=1e-6)
    assert figures.engine_power_max_shp == power.max()
    assert figures.mast_torque_max_inlb == rows[:, COLUMN.mast_torque_inlb].max()
    assert figures.pitch_rate_rms_deg_s == pytest.approx(np.sqrt(np.mean(rows[:, COLUMN.pitch_rate_deg_s] ** 2)))
    assert figures.pitch_excursion_deg == np.ptp(rows[:, COLUMN.pitch_deg])


def test_a_flight_that_ends_by_itself_is_not_completed():
    # Descending through the ground at cruise speed.
    programme = Programme(np.array([0.0, 20.0]), np.full(2, kt(170.0)), np.zeros(2), np.array([30.0, 0.0]))
    programme = Programme(programme.time, programme.airspeed, programme.nacelle_angle, np.array([5.0, 0.0]))
    low = FlightSetup(programme=programme, start=dataclasses.replace(programme.at(0.0), altitude=0.05))
    flyer = BatchFlyer(low, workers=1)
    figures = flyer.fly_one(BatchFlight(programme, duration=60.0))
    single = Simulation(low)
    rows = single.run(15_000)
    assert figures.frames == len(rows)
    assert figures.completed is not single.finished
    assert single.finished


def test_every_objective_has_a_value(flown):
    values = {name: objective_value(flown[0], name) for name in OBJECTIVES}
    assert all(np.isfinite(value) for value in values.values())
    assert values["corridor_proximity"] == -flown[0].worst_margin_kt
    with pytest.raises(InputError, match="is not an objective"):
        objective_value(flown[0], "beauty")


def test_a_flight_without_frames_has_no_figures():
    with pytest.raises(InputError, match="no frames"):
        figures_from_sums(np.zeros(MERIT_SIZE), 0.004)
    assert deviation_from_sums(0.0, 0.0, 0) == 0.0


def test_a_start_without_trim_is_refused():
    programme = Programme.hold(airspeed=kt(20.0), nacelle_angle=deg(0.0), altitude=100.0)
    with pytest.raises(InputError):
        BatchFlyer(FlightSetup(programme=programme), workers=1)
