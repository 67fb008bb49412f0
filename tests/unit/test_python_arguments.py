"""Python callers who give a plausible wrong thing get a sentence, and never reach compiled code with it."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

import rtsim
import scenarios
from rtsim.errors import InputError
from rtsim.pilot.problem import MocmError

PLANT = control.ss(
    [[0, 1], [-1, -1]], [[0, 1], [1, 0]], [[1, 0]], [[0, 0]], inputs=["stick", "gust"], outputs=["height"]
)
AIRCRAFT = rtsim.load_aircraft
HOLD = rtsim.Programme.hold(airspeed=40.0, nacelle_angle=1.2, altitude=100.0)


def test_one_name_is_not_read_letter_by_letter():
    one = rtsim.design_mocm(PLANT, controls="stick", disturbances="gust", displays="height")
    several = rtsim.design_mocm(PLANT, controls=["stick"], disturbances=["gust"], displays=["height"])
    assert np.array_equal(one.l_plant, several.l_plant)


@pytest.mark.parametrize(
    ("plant", "changes", "words"),
    [
        (
            control.tf([1], [1, 1]),
            {},
            r"plant: is a TransferFunction \[E_DIM\]; allowed: control.StateSpace.*control.ss",
        ),
        (None, {}, "plant: is a NoneType"),
        (np.eye(2), {}, "plant: is a ndarray"),
        ((np.eye(2) * 1j, np.eye(2), np.eye(2)), {}, "plant A: is not a rectangular array of real numbers"),
        ((np.eye(2), [[1, 2]], [[1, 0]]), {}, "plant: has matrices that do not fit together"),
        (
            PLANT,
            {"controls": "stik"},
            r"controls: is not a signal of the plant \(got 'stik'\).*perhaps 'stick' is meant",
        ),
        (PLANT, {"controls": 3.5}, "controls: is no list of signals"),
        (PLANT, {"displays": ["height", 0]}, "displays: names a signal twice"),
        (PLANT, {"start": 3}, "start: is no design of a pilot"),
        (PLANT, {"disturbance_matrix": "gust"}, "E: is not a rectangular array of numbers"),
    ],
)
def test_design_mocm_refuses_what_is_no_plant_and_no_signal(plant, changes, words):
    with pytest.raises(InputError, match=words) as caught:
        rtsim.design_mocm(plant, **{"controls": "stick", "disturbances": "gust", **changes})
    assert isinstance(caught.value, MocmError) or "plant" not in caught.value.key


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda craft, x, u: craft.step(x[:3], u, nacelle_angle=1.2), r"x: has the wrong shape \(got \(3,\)\)"),
        (lambda craft, x, u: craft.step(x, np.append(u, 0.0), nacelle_angle=1.2), "u: has the wrong shape"),
        (lambda craft, x, _: craft.derivative(x, [0.0], 1.2), "u: has the wrong shape"),
        (lambda craft, x, u: craft.outputs([*x, 1.0], u, 1.2), "x: has the wrong shape"),
        (lambda craft, _x, _u: craft.trim(airspeed="60", nacelle=1.2), "airspeed: is not a finite number"),
        (lambda craft, _x, _u: craft.trim(airspeed=40.0, nacelle=1.2, acceleration=math.nan), "acceleration: is not"),
        (lambda craft, _x, _u: craft.linearize(airspeed=40.0, nacelle=None), "nacelle: is not a finite number"),
        (lambda *_: rtsim.load_aircraft(form="layerd"), "form: is not known .* perhaps 'layered' is meant"),
        (lambda *_: rtsim.load_aircraft(3), "path: is no path"),
    ],
)
def test_the_aircraft_takes_arrays_of_its_own_size_only(call, words):
    craft = AIRCRAFT()
    point = craft.trim(airspeed=40.0, nacelle=1.2)
    with pytest.raises(InputError, match=words):
        call(craft, point.x, point.u)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda _: rtsim.Simulation("hover"), "setup: is a str; allowed: FlightSetup"),
        (lambda _: rtsim.Simulation(rtsim.FlightSetup(programme="hover")), "setup.programme: is a str"),
        (lambda flight: flight.step((0, 0, 0)), "command: is a tuple; allowed: Command"),
        (lambda flight: flight.run("10"), "frames: is no whole number"),
        (lambda flight: flight.run(-1), "frames: is no whole number"),
        (lambda flight: flight.run(10, np.empty((5, 3))), "rows: has the wrong shape"),
        (lambda flight: flight.restore(None), "snapshot: is a NoneType"),
        (lambda flight: flight.set_pilot("autopilot"), "mode: is no mode of the pilot"),
        (lambda _: scenarios.fly("hover", overrides={"duration": 3}), "overrides: is a dict; allowed: Overrides"),
        (lambda _: scenarios.fly("hover", outputs="a.parquet"), "outputs: is a str; allowed: FlightOutputs"),
        (lambda _: scenarios.replay_log(None), "path: is no path"),
    ],
)
def test_a_simulation_takes_its_own_kinds_only(call, words):
    flight = rtsim.Simulation(rtsim.FlightSetup(programme=HOLD))
    with pytest.raises(InputError, match=words):
        call(flight)
