"""Compiled batches: equal to single flights bit for bit, whoever flies what and however many there are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.errors import InputError
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.measures.metrics import OBJECTIVES, FlightFigures, finished, measured, new_sums, objective_value
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
        assert np.array_equal(measured(rows, programme, simulation.dt), figures.numbers, equal_nan=True)
        assert figures.frames == np.ceil(programme.duration * 250 - 1e-6)


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
    assert FlightFigures(measured(rows, programme, single.dt, ended=True)) == figures


def test_every_objective_has_a_value(flown):
    values = {name: objective_value(flown[0], name) for name in OBJECTIVES}
    assert all(np.isfinite(value) for value in values.values())
    assert values["corridor_proximity"] == -flown[0].worst_margin_kt
    assert values["pitch_excursion"] == flown[0].pitch_max_deg - flown[0].pitch_min_deg
    assert values["stick_effort"] == flown[0].stick.rms_rate
    with pytest.raises(InputError, match="is not an objective"):
        objective_value(flown[0], "beauty")


def test_a_flight_without_frames_has_no_figures():
    with pytest.raises(InputError, match="no frames"):
        finished(new_sums(), 0.004)


def test_a_start_without_trim_is_refused():
    programme = Programme.hold(airspeed=kt(20.0), nacelle_angle=deg(0.0), altitude=100.0)
    with pytest.raises(InputError):
        BatchFlyer(FlightSetup(programme=programme), workers=1)
