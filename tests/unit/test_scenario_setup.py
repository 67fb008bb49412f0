"""A flight setup survives a log's metadata exactly."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rtsim.loop.simulation import FlightSetup
from rtsim.programme import Programme
from scenarios.files.loader import library_names, load_scenario
from scenarios.files.options import Overrides, with_overrides
from scenarios.flight.flight_setup import corridor_outline, flight_frames, flight_setup, setup_from_json, setup_to_json


def through_json(setup: FlightSetup) -> FlightSetup:
    """A setup as a replay reads it."""
    return setup_from_json(json.loads(json.dumps(setup_to_json(setup))))


def assert_same(one: FlightSetup, two: FlightSetup) -> None:
    """Every field, and every number of the programme, is the same to the last bit."""
    for field in dataclasses.fields(FlightSetup):
        first, second = getattr(one, field.name), getattr(two, field.name)
        if isinstance(first, Programme):
            for name in ("time", "airspeed", "nacelle_angle", "altitude"):
                assert np.array_equal(getattr(first, name), getattr(second, name))
        else:
            assert first == second, field.name
            assert type(first) is type(second), field.name


@given(
    name=st.sampled_from(library_names()),
    plant=st.sampled_from(["lpv", "lpv-plain", "nonlinear"]),
    corridor=st.sampled_from(["design", "flight"]),
    wind=st.floats(-20.0, 20.0),
    seed=st.integers(0, 2**63 - 1),
    noise=st.booleans(),
)
def test_setups_read_back_exactly(name: str, plant: str, corridor: str, wind: float, seed: int, noise: bool) -> None:
    overrides = Overrides(plant=plant, corridor=corridor, wind=wind, seed=seed, pilot_noise=noise)  # type: ignore[arg-type]
    setup = flight_setup(with_overrides(load_scenario(name), overrides))
    options = setup.options
    assert (options.plant, options.corridor, options.wind, options.seed, options.pilot_noise) == (
        plant, corridor, wind, seed, noise,
    )  # fmt: skip
    assert_same(through_json(setup), setup)


def test_the_last_frame_starts_before_the_end() -> None:
    conversion = load_scenario("typical_conversion")  # 65.91667 s
    assert flight_frames(conversion) == 16480
    assert flight_frames(load_scenario("hover")) == 30000
    assert flight_frames(with_overrides(conversion, Overrides(duration=0.004))) == 1


def test_the_outline_shows_the_boundaries_as_they_are() -> None:
    outline = corridor_outline("design")
    points = dict(zip(outline.high_nacelle_deg, outline.high_kt, strict=True))
    assert min(outline.low_nacelle_deg) <= 0.0
    assert max(outline.low_nacelle_deg) >= 90.0
    assert max(points.values()) <= 171.0  # 260 kn hold on the downstop only and would hide the corridor
    middle = np.interp(50.0, outline.centre_nacelle_deg, outline.centre_kt)
    low = np.interp(50.0, outline.low_nacelle_deg, outline.low_kt)
    high = np.interp(50.0, outline.high_nacelle_deg, outline.high_kt)
    assert abs(middle - 0.5 * (low + high)) < 0.5
