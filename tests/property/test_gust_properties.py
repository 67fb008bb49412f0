"""Properties of gusts that hold for any gust, severity, speed and height."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rtsim.atmosphere import dryden_kernels as dryden
from rtsim.atmosphere.air import GUST_SHAPES, gust_tables, new_gust_state
from rtsim.atmosphere.gust_kernels import GUST, gust_shape, gust_step
from rtsim.atmosphere.specification import AirSpecification, Gust, Turbulence

DT = 0.01
amplitudes = st.floats(-30.0, 30.0)
speeds = st.floats(-20.0, 130.0)
heights = st.floats(-5.0, 12_000.0)
normals = st.lists(st.floats(-4.0, 4.0), min_size=6, max_size=6).map(np.array)


@st.composite
def gusts(draw):
    return Gust(
        start=draw(st.floats(0.0, 1.0)),
        ahead=draw(amplitudes),
        below=draw(amplitudes),
        lateral=draw(amplitudes),
        shape=draw(st.sampled_from(list(GUST_SHAPES))),
        axes=draw(st.sampled_from(["earth", "body"])),
        **{draw(st.sampled_from(["duration", "length"])): draw(st.floats(0.01, 100.0))},
    )


@given(st.sampled_from(list(GUST_SHAPES.values())), st.floats(-10.0, 200.0), st.floats(0.0, 100.0))
def test_a_shape_is_a_share(shape, entered, extent):
    assert 0.0 <= gust_shape(shape, entered, extent) <= 1.0


@given(st.lists(gusts(), max_size=4), speeds, heights, st.floats(-1.4, 1.4), st.floats(-2.0, 2.0), st.integers(1, 200))
def test_body_and_earth_components_are_one_vector_within_the_amplitudes(some, speed, height, pitch, bank, frames):
    air = AirSpecification(gusts=tuple(some))
    tables, state = gust_tables(air), new_gust_state(air)
    for k in range(frames):
        gust_step(tables, state, speed, height, (pitch, bank), k * DT, DT if k else 0.0, np.zeros(0))
    u, v, w = state[[GUST.u, GUST.v, GUST.w]]
    size = np.linalg.norm((u, v, w))
    assert abs(size - np.linalg.norm(state[[GUST.ahead, GUST.right, GUST.below]])) < 1e-9
    assert size <= sum(np.linalg.norm((gust.ahead, gust.lateral, gust.below)) for gust in some) + 1e-9
    assert (state[[GUST.p, GUST.q, GUST.r]] == 0.0).all()
    # What the airspeed indicator and the climb rate see, from the body components.
    down = v * np.sin(bank) + w * np.cos(bank)
    assert abs(u * np.cos(pitch) + down * np.sin(pitch) - state[GUST.ahead]) < 1e-9
    assert abs(v * np.cos(bank) - w * np.sin(bank) - state[GUST.right]) < 1e-9


@given(st.floats(0.0, 20.0), speeds, heights, st.lists(normals, min_size=1, max_size=20))
def test_turbulence_is_linear_in_its_normals_and_finite(wind, speed, height, noise):
    """Twice the noise is twice the gust: the filters are linear whatever the condition."""
    air = AirSpecification(turbulence=Turbulence(wind_at_20_ft=wind, fade_in=0.0), lateral=True)
    outs = []
    for factor in (1.0, 2.0):
        state = new_gust_state(air, factor * noise[0])
        for k, row in enumerate(noise):
            gust_step(gust_tables(air), state, speed, height, (0.1, -0.2), k * DT, DT if k else 0.0, factor * row)
        outs.append(state[GUST.u : GUST.busy].copy())
    assert np.isfinite(outs[0]).all()
    np.testing.assert_allclose(outs[1], 2.0 * outs[0], rtol=1e-9, atol=1e-12)


@given(heights, st.floats(0.0, 30.0), st.floats(0.0, 30.0))
def test_intensity_grows_with_wind_and_is_never_negative(height, one, two):
    tables = gust_tables(AirSpecification()).turbulence
    weak = dryden.turbulence_scales(tables, height, min(one, two))
    strong = dryden.turbulence_scales(tables, height, max(one, two))
    assert 0.0 <= weak[0] <= strong[0] * (1.0 + 1e-12)
    assert 0.0 <= weak[1] <= strong[1] * (1.0 + 1e-12)
    assert weak[2:] == strong[2:]
    assert min(weak[2:]) > 0.0


@given(st.floats(1e-9, 50.0))
def test_the_vertical_filter_keeps_its_covariance(s):
    """F F' + G G' = 1 for every distance."""
    columns = np.array([dryden.advance_second_order(*unit, s, 0.0, 0.0) for unit in ((1.0, 0.0), (0.0, 1.0))]).T
    noise = np.array([dryden.advance_second_order(0.0, 0.0, s, *unit) for unit in ((1.0, 0.0), (0.0, 1.0))]).T
    np.testing.assert_allclose(columns @ columns.T + noise @ noise.T, np.eye(2), atol=1e-12)
