"""Discrete gusts: shapes, axes, extents, and that no gust is exactly no gust."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtsim.atmosphere import gust_kernels as kernels
from rtsim.atmosphere.air import LIVE_SLOTS, add_gust, gust_tables, new_gust_state, normals_needed, set_turbulence
from rtsim.atmosphere.specification import AirSpecification, Gust, Turbulence
from rtsim.errors import InputError
from rtsim.random_streams import STREAM_PILOT, STREAM_TURBULENCE, seed_sequence, stream_generator
from rtsim.units import deg, kt

DT = 0.004
NO_NORMALS = np.zeros(0)


SHOWN = [getattr(kernels.GUST, name) for name in ("u", "w", "q", "ahead", "below", "v", "p", "r", "right")]
LEVEL = (0.0, 0.0)


def fly(air, *, seconds, speed=50.0, pitch=0.0, bank=0.0):
    """Columns u, w, q, ahead, below, v, p, r, right over time."""
    tables, state = gust_tables(air), new_gust_state(air)
    history = []
    for k in range(round(seconds / DT) + 1):
        kernels.gust_step(tables, state, speed, 100.0, (pitch, bank), k * DT, DT if k else 0.0, NO_NORMALS)
        history.append(state[SHOWN])
    return np.array(history), state


def test_one_minus_cosine_rises_and_falls_over_its_duration():
    history, state = fly(AirSpecification(gusts=(Gust(start=1.0, below=6.0, duration=2.0),)), seconds=4.0)
    time = DT * np.arange(len(history))
    inside = (time >= 1.0) & (time < 3.0)
    expected = np.where(inside, 3.0 * (1.0 - np.cos(math.pi * (time - 1.0))), 0.0)
    assert history[:, 1] == pytest.approx(expected, abs=1e-12)
    assert (history[~inside][:, :3] == 0.0).all()
    assert (history[:, 0] == 0.0).all()
    assert (history[:, 2] == 0.0).all()
    assert state[kernels.GUST.size + kernels.SLOT.shape] == kernels.SHAPE_NONE


def test_build_up_and_ramp_rise_and_stay():
    air = AirSpecification(
        gusts=(
            Gust(start=1.0, ahead=4.0, duration=2.0, shape="build-up"),
            Gust(start=5.0, ahead=-8.0, duration=1.0, shape="ramp"),
        )
    )
    history, _ = fly(air, seconds=8.0)
    ahead = history[:, 3]
    assert ahead[round(1.5 / DT)] == pytest.approx(2.0 * (1.0 - math.cos(math.pi * 0.25)))
    assert ahead[round(4.0 / DT)] == pytest.approx(4.0)
    assert ahead[round(5.2 / DT)] == pytest.approx(2.4)
    assert ahead[-1] == pytest.approx(-4.0)


def test_a_sharp_edge_is_there_at_once():
    history, _ = fly(AirSpecification(gusts=(Gust(start=0.5, below=-3.0, duration=0.0, shape="ramp"),)), seconds=1.0)
    assert (history[:125, 1] == 0.0).all()
    assert (history[125:, 1] == -3.0).all()


@pytest.mark.parametrize("speed", [60.0, -60.0])
def test_length_is_the_distance_flown_through_it(speed):
    # 120 m at 60 m/s: two seconds. The start lies within a frame: only the rest of that frame is flown inside.
    gust = Gust(start=0.5 + 0.3 * DT, ahead=5.0, length=120.0)
    same = Gust(start=0.5 + 0.3 * DT, ahead=5.0, duration=2.0)
    by_length, _ = fly(AirSpecification(gusts=(gust,)), seconds=4.0, speed=speed)
    by_time, _ = fly(AirSpecification(gusts=(same,)), seconds=4.0, speed=speed)
    assert by_length == pytest.approx(by_time, abs=1e-9)
    assert by_time.max() == pytest.approx(5.0, abs=1e-3)


def test_in_hover_a_length_passes_at_the_guard_speed():
    air = AirSpecification(gusts=(Gust(start=0.0, ahead=5.0, length=20.0),), minimum_speed=10.0)
    history, _ = fly(air, seconds=2.5, speed=0.0)
    assert history[round(1.0 / DT), 3] == pytest.approx(5.0)
    assert (history[round(2.004 / DT) :, 3] == 0.0).all()


def test_earth_gusts_turn_with_the_pitch_attitude():
    pitch = deg(30.0)
    air = AirSpecification(gusts=(Gust(start=0.0, ahead=2.0, below=6.0, duration=0.0, shape="ramp"),))
    history, _ = fly(air, seconds=0.01, pitch=pitch)
    gust_u, gust_w, _, ahead, below = history[-1, :5]
    assert (ahead, below) == pytest.approx((2.0, 6.0))
    assert gust_u == pytest.approx(2.0 * math.cos(pitch) - 6.0 * math.sin(pitch))
    assert gust_w == pytest.approx(2.0 * math.sin(pitch) + 6.0 * math.cos(pitch))
    # The horizontal airspeed u cos + w sin takes exactly the gust from ahead, the climb rate none of it.
    assert gust_u * math.cos(pitch) + gust_w * math.sin(pitch) == pytest.approx(2.0)


def test_body_gusts_stay_with_the_body():
    pitch = deg(-20.0)
    air = AirSpecification(gusts=(Gust(start=0.0, ahead=2.0, below=6.0, duration=0.0, shape="ramp", axes="body"),))
    history, _ = fly(air, seconds=0.01, pitch=pitch)
    gust_u, gust_w, _, ahead, below = history[-1, :5]
    assert (gust_u, gust_w) == pytest.approx((2.0, 6.0))
    assert ahead == pytest.approx(2.0 * math.cos(pitch) + 6.0 * math.sin(pitch))
    assert below == pytest.approx(6.0 * math.cos(pitch) - 2.0 * math.sin(pitch))


@pytest.mark.parametrize(
    "air",
    [
        AirSpecification(),
        AirSpecification(turbulence=Turbulence.of_severity("none")),
        AirSpecification(gusts=(Gust(start=1e4, ahead=9.0, duration=1.0), Gust(start=0.0, duration=5.0))),
    ],
    ids=["calm", "severity none", "gusts elsewhere or of no size"],
)
def test_no_gust_is_exactly_no_gust(air):
    assert normals_needed(new_gust_state(air)) == 0
    history, _ = fly(air, seconds=2.0, pitch=deg(-9.0))
    assert history.tobytes() == np.zeros_like(history).tobytes()  # not even a negative zero


def test_busy_says_when_a_frame_may_leave_the_gusts_out():
    air = AirSpecification(gusts=(Gust(start=0.5, ahead=1.0, duration=0.5),))
    assert new_gust_state(AirSpecification())[kernels.GUST.busy] == 0.0
    tables, state = gust_tables(air), new_gust_state(air)
    busy = [state[kernels.GUST.busy]]
    for time in (0.0, 0.6, 1.1, 1.2):
        kernels.gust_step(tables, state, 50.0, 100.0, LEVEL, time, DT, NO_NORMALS)
        busy.append(state[kernels.GUST.busy])
    assert busy == [1.0, 1.0, 1.0, 1.0, 0.0]
    assert (state[SHOWN] == 0.0).all()
    add_gust(state, Gust(start=0.0, ahead=1.0, duration=0.1))
    assert state[kernels.GUST.busy] == 1.0
    calm = new_gust_state(AirSpecification())
    set_turbulence(calm, Turbulence.of_severity("light"), np.zeros(3))
    assert calm[kernels.GUST.busy] == 1.0


def test_a_gust_from_the_side_is_felt_along_body_y_and_banked_along_z_too():
    """Air from the right adds to v; in a right bank the belly meets it: w decreases."""
    side = Gust(start=0.0, lateral=5.0, duration=0.0, shape="ramp")
    level, _ = fly(AirSpecification(gusts=(side,)), seconds=0.1, pitch=0.3)
    assert level[-1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 5.0])
    assert (level[:, :5] == 0.0).all()
    banked, _ = fly(AirSpecification(gusts=(side,)), seconds=0.1, pitch=0.3, bank=deg(30.0))
    assert banked[-1, [5, 1]] == pytest.approx([5.0 * math.cos(deg(30.0)), -2.5])
    along_y = Gust(start=0.0, lateral=5.0, duration=0.0, shape="ramp", axes="body")
    body, _ = fly(AirSpecification(gusts=(along_y,)), seconds=0.1, bank=deg(30.0))
    assert body[-1, [5, 8, 4]] == pytest.approx([5.0, 5.0 * math.cos(deg(30.0)), 2.5])


def test_a_gust_in_the_plane_of_symmetry_is_not_felt_from_the_side():
    """Not even as a negative zero: symmetric flights stay what they are to the last bit."""
    history, _ = fly(
        AirSpecification(gusts=(Gust(start=0.0, ahead=-3.0, below=2.0, duration=1.0),)), seconds=1.0, pitch=-0.2
    )
    assert history[:, 5:].tobytes() == np.zeros((len(history), 4)).tobytes()


def test_gusts_add_up():
    one, two = Gust(start=0.1, ahead=3.0, duration=1.0), Gust(start=0.4, ahead=-1.0, below=2.0, length=40.0)
    together, _ = fly(AirSpecification(gusts=(one, two)), seconds=2.0, pitch=0.1)
    first, _ = fly(AirSpecification(gusts=(one,)), seconds=2.0, pitch=0.1)
    second, _ = fly(AirSpecification(gusts=(two,)), seconds=2.0, pitch=0.1)
    assert together == pytest.approx(first + second, abs=1e-12)


def test_a_live_gust_is_felt_from_the_next_step():
    air = AirSpecification()
    tables, state = gust_tables(air), new_gust_state(air)
    kernels.gust_step(tables, state, 50.0, 100.0, LEVEL, 1.0, DT, NO_NORMALS)
    add_gust(state, Gust(start=1.0, ahead=4.0, duration=0.0, shape="ramp"))
    kernels.gust_step(tables, state, 50.0, 100.0, LEVEL, 1.0 + DT, DT, NO_NORMALS)
    assert state[kernels.GUST.u] == 4.0


def test_room_for_live_gusts_is_finite_and_given_back():
    air = AirSpecification(gusts=(Gust(start=0.0, ahead=1.0, duration=1.0, shape="build-up"),))
    tables, state = gust_tables(air), new_gust_state(air)
    pulse = Gust(start=0.0, ahead=1.0, duration=0.1)
    for _ in range(LIVE_SLOTS):
        add_gust(state, pulse)
    with pytest.raises(InputError, match="no room for another gust"):
        add_gust(state, pulse)
    kernels.gust_step(tables, state, 50.0, 100.0, LEVEL, 0.2, DT, NO_NORMALS)
    add_gust(state, pulse)


def test_turbulence_switched_on_in_flight_takes_normals_from_then_on():
    state = new_gust_state(AirSpecification())
    set_turbulence(state, Turbulence.of_severity("none"), np.zeros(3))
    assert normals_needed(state) == 0
    set_turbulence(state, Turbulence.of_severity("light", fade_in=1.0), np.array([1.0, 2.0, 3.0]))
    assert normals_needed(state) == 3
    set_turbulence(state, Turbulence.of_severity("none", fade_in=0.0), np.zeros(3))
    assert normals_needed(state) == 3  # so that the stream does not depend on how a run is cut into pieces


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"start": 0.0, "ahead": 1.0}, "needs either a duration or a length"),
        ({"start": 0.0, "ahead": 1.0, "duration": 1.0, "length": 1.0}, "needs either a duration or a length"),
        ({"start": 0.0, "ahead": kt(61.0), "duration": 1.0}, "ahead: is out of range"),
        ({"start": 0.0, "below": math.inf, "duration": 1.0}, "below: is out of range"),
        ({"start": -1.0, "below": 1.0, "duration": 1.0}, "start: is out of range"),
        ({"start": 0.0, "below": 1.0, "duration": 0.0}, "duration: is out of range"),
        ({"start": 0.0, "below": 1.0, "length": 0.0}, "length: is out of range"),
        ({"start": 0.0, "below": 1.0, "length": 1.0, "shape": "square"}, "one-minus-cosine, build-up, ramp"),
        ({"start": 0.0, "below": 1.0, "length": 1.0, "axes": "wind"}, "earth, body"),
    ],
)
def test_mistakes_in_gusts(arguments, words):
    with pytest.raises(InputError, match=words):
        Gust(**arguments)


def test_a_guard_speed_out_of_range():
    with pytest.raises(InputError, match="minimum_speed: is out of range"):
        AirSpecification(minimum_speed=0.0)


def test_streams_of_one_seed_differ_and_repeat():
    draws = {
        (seed, *stream): tuple(stream_generator(seed, *stream).standard_normal(4))
        for seed in (0, 1, 5, 2**32 + 5, 2**63 - 1)
        for stream in ((STREAM_PILOT,), (STREAM_TURBULENCE,), (2, 1), (2, 2), (2, 1, 1))
    }
    assert len(set(draws.values())) == len(draws)
    assert tuple(stream_generator(5, STREAM_TURBULENCE).standard_normal(4)) == draws[5, STREAM_TURBULENCE]


def test_the_pilot_stream_is_that_of_seed_and_zero():
    assert (seed_sequence(7, STREAM_PILOT).generate_state(4) == np.random.SeedSequence([7, 0]).generate_state(4)).all()


@pytest.mark.parametrize(("seed", "stream"), [(-1, 0), (2**63, 0), (0, -1), (0, 2**32)])
def test_numbers_outside_the_tree(seed, stream):
    with pytest.raises(InputError, match="is out of range"):
        stream_generator(seed, stream)
