"""Stability of the loop as flown: sampled, with the kernels of aircraft and pilot, frozen over the whole grid."""

from __future__ import annotations

import re

import numpy as np
import pytest

from docs.margins import BEGIN, LEAST_GAIN_DB, LEAST_PHASE_DEG, PAGE, margins, margins_at
from rtsim.analysis.frozen_loop import FrozenCommand, frozen_loop, stability_map
from rtsim.analysis.lateral_loop import lateral_stability_map, lateral_tables
from rtsim.choices import OUTER_LOOPS, OuterLoop
from rtsim.lpv.files.storage import load_database
from rtsim.lpv.lpv_kernels import lpv_step, work_size
from rtsim.lpv.tables import prepare_tables
from rtsim.pilot.layout_kernels import pilot_state_size
from rtsim.pilot.pilot_kernels import mocm_advance, mocm_engage, mocm_output
from rtsim.pilot.tables import load_pilot_tables
from rtsim.units import deg, kt

DATABASE = load_database()
TABLE_1 = [(0, 90), (24, 82), (40, 82), (61, 75), (80, 75), (105, 50), (130, 50), (140, 25), (150, 0), (170, 0)]
"""Points of the paper's conversion: airspeed [kn], nacelle angle [deg]."""


@pytest.mark.parametrize("mid_cells", [False, True])
def test_default_form_is_stable_at_every_valid_point_and_mid_cell(mid_cells: bool) -> None:
    result = stability_map(DATABASE, mid_cells=mid_cells)
    expected = 600 if not mid_cells else 500
    assert np.isfinite(result.growth).sum() > expected
    assert result.unstable == []
    assert np.nanmax(result.growth) < -0.03


@pytest.mark.parametrize("mid_cells", [False, True])
def test_the_lateral_half_is_stable_at_every_valid_point_and_mid_cell(mid_cells: bool) -> None:
    """Held to the bound of the longitudinal half."""
    result = lateral_stability_map(DATABASE, mid_cells=mid_cells)
    assert np.isfinite(result.growth).sum() > (500 if mid_cells else 600)
    assert result.unstable == []
    assert np.nanmax(result.growth) < -0.03


def test_the_lateral_half_keeps_its_margins() -> None:
    """A sample of the grid; where a margin is short the page names it."""
    sample = margins(every=60)
    assert len(sample) > 10
    table = PAGE.read_text(encoding="utf-8").split(BEGIN)[1]
    named = {
        row.split("|")[1].split(",")[1].strip(): row.split("|")[-2] for row in table.split("\n\n")[0].splitlines()[3:5]
    }
    assert set(named) == {"lateral stick", "pedal"}
    for point in sample:
        for hand, exceptions in enumerate(named.values()):
            short = point.phase_deg[hand] < LEAST_PHASE_DEG or point.gain_db[hand] < LEAST_GAIN_DB
            assert not short or f"{point.name} " in exceptions, point


def test_the_page_tells_the_weakest_margins_as_they_are() -> None:
    """The first that docs/six-degrees.md names for each hand, at the grid points and in the middles of cells."""
    tables = lateral_tables(DATABASE)
    table = PAGE.read_text(encoding="utf-8").split(BEGIN)[1]
    rows = re.findall(
        r"^\| (?:grid|middles).*?\| (\S+) at ([-\d.]+)/([-\d.]+).*?\| (\S+) at ([-\d.]+)/([-\d.]+)", table, re.MULTILINE
    )
    assert len(rows) == 4
    for number, (phase, *at_phase, gain, v, n) in enumerate(rows):
        hand = number % 2
        found = [margins_at(DATABASE, tables, kt(float(a)), deg(float(b))) for a, b in (at_phase, (v, n))]
        assert found[0].phase_deg[hand] == pytest.approx(float(phase), abs=0.4)
        assert found[1].gain_db[hand] == pytest.approx(float(gain), abs=0.1)


@pytest.mark.parametrize("mid_cells", [False, True])
def test_pi_form_grows_nowhere_faster_than_allowed(mid_cells: bool) -> None:
    result = stability_map(DATABASE, outer_loop="pi", mid_cells=mid_cells)
    assert np.nanmax(result.growth) < 0.02
    assert result.unstable == []


@pytest.mark.parametrize(("airspeed_kt", "nacelle_deg"), TABLE_1)
def test_margins_along_the_typical_conversion(airspeed_kt: float, nacelle_deg: float) -> None:
    """Acceptance bands: stick 0.8-4 rad/s, 20 deg, 4.5 dB; lever 0.15-2.5 rad/s, 20 deg, 4 dB."""
    loop = frozen_loop(DATABASE, FrozenCommand(kt(airspeed_kt), deg(nacelle_deg)))
    margins = loop.margins()
    assert 0.8 <= margins.w_c[0] <= 4.0
    assert 0.15 <= margins.w_c[1] <= 2.5
    assert np.all(margins.phase_margin >= 20.0)
    assert margins.gain_margin[0] >= 4.5
    assert margins.gain_margin[1] >= 4.0


@pytest.mark.parametrize("outer_loop", OUTER_LOOPS)
def test_the_linear_map_predicts_the_flight(outer_loop: OuterLoop) -> None:
    """A small upset flown with the kernels for 8 s against powers of the frozen map."""
    condition = FrozenCommand(kt(81.0), deg(75.0))
    loop = frozen_loop(DATABASE, condition, outer_loop=outer_loop)
    lpv, pilot = prepare_tables(DATABASE), load_pilot_tables(DATABASE, outer_loop)
    level = DATABASE.level_layer
    i = int(np.argmin(np.abs(DATABASE.airspeed - condition.airspeed)))
    j = int(np.argmin(np.abs(DATABASE.nacelle - condition.nacelle_angle)))
    condition = FrozenCommand(float(DATABASE.airspeed[i]), float(DATABASE.nacelle[j]))
    loop = frozen_loop(DATABASE, condition, outer_loop=outer_loop)
    x, u = DATABASE.x_ref[level, i, j].copy(), DATABASE.u_ref[level, i, j].copy()
    names = [variable.name for variable in DATABASE.states]
    x[names.index("altitude")] = condition.altitude
    hands = [[variable.name for variable in DATABASE.inputs].index(name) for name in ("stick", "lever")]
    reference = np.array([condition.airspeed, 0.0, condition.altitude, 0.0, 0.0])
    state = np.zeros(pilot_state_size(pilot))
    mocm_engage(pilot, state, x, condition.nacelle_angle, 0.0, reference, u[hands])
    base = np.concatenate([x, state])
    upset = np.zeros_like(base)
    upset[names.index("pitch")], upset[names.index("w")] = 1e-4, -3e-3
    x += upset[: x.size]
    out, silence, path, work = np.zeros(2), np.zeros(0), np.zeros((3, 3)), np.zeros(work_size(lpv))
    path[:, 0] = condition.nacelle_angle
    matrix, predicted = loop.matrix, upset.copy()
    for _ in range(2000):
        mocm_output(pilot, state, x, condition.nacelle_angle, 0.0, reference, silence, out)
        mocm_advance(pilot, state, x, condition.nacelle_angle, 0.0, reference, out, silence, 0.004)
        u[hands] = out
        lpv_step(lpv, x, u, path, 0.004, work)
        predicted = matrix @ predicted
    flown = np.concatenate([x, state]) - base
    kept = [names.index(name) for name in ("u", "w", "q", "pitch", "altitude")]
    assert np.linalg.norm(flown[kept] - predicted[kept]) < 0.03 * np.linalg.norm(flown[kept])
    assert np.linalg.norm(flown[kept]) > 1e-6


def test_eigenvalues_are_rates_and_come_slowest_first() -> None:
    loop = frozen_loop(DATABASE, FrozenCommand(0.0, deg(90.0)))
    values = loop.eigenvalues()
    assert np.all(np.diff(values.real) <= 1e-12)
    assert loop.growth() == values[0].real
    assert np.max(np.abs(np.exp(values * loop.dt)) - 1.0) < 0.0
