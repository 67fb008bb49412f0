"""The checks of a database, and the shipped database under them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rtsim.aircraft.points import Condition
from rtsim.aircraft.xv15.model import Xv15
from rtsim.cli.model import _inside_corridor
from rtsim.lpv.building.build import build_database
from rtsim.lpv.building.checks import NEIGHBOUR_LIMIT, check_neighbours, describe
from rtsim.lpv.building.grid import Grid
from rtsim.lpv.building.xv15_grid import source_sha256, still_trims
from rtsim.lpv.files.storage import load_database


@pytest.fixture(scope="module")
def shipped():
    return load_database()


def test_paper_neighbour_check_holds_inside_the_corridor(shipped):
    """fig2_grid: relative interpolation error of neighbouring trims <= 1e-2."""
    report = check_neighbours(shipped, inside=_inside_corridor(shipped))
    assert len(report.errors) > 1800
    assert report.largest("airspeed").error <= NEIGHBOUR_LIMIT
    assert report.largest("nacelle").error <= NEIGHBOUR_LIMIT
    assert report.above() == ()
    # the only pairs left out are those across the flap schedule on the downstop
    skipped = [e for e in report.errors if e.flap_moves]
    assert all(shipped.airspeed[max(e.start[0], e.end[0])] > 87.4 for e in skipped)  # 170 kn
    assert all(shipped.nacelle[min(e.start[1], e.end[1])] <= 0.0 for e in skipped)
    assert len(skipped) < 90


def test_most_of_the_corridor_has_trims(shipped):
    inside = _inside_corridor(shipped)
    missing = inside & ~shipped.valid[shipped.level_layer]
    assert missing.sum() <= 0.06 * inside.sum()
    # what is missing lies at the edges: the slow side near stall, or the fast side with the nacelles upright
    for v, n in np.argwhere(missing):
        column = np.flatnonzero(inside[:, n])
        valid = np.flatnonzero(shipped.valid[shipped.level_layer, :, n])
        assert v < valid[0] or v > valid[-1], (shipped.airspeed[v], shipped.nacelle[n])
        assert column.size


def test_database_is_of_this_aircraft(shipped):
    assert shipped.attributes["source_sha256"] == source_sha256(), "the aircraft changed: run 'rtsim model build'"


def test_trims_of_the_database_are_trims_of_the_nonlinear_model(shipped):
    assert still_trims(shipped), "the aircraft changed: run 'rtsim model build'"
    moved = shipped.x_ref.copy()
    moved[..., 3] += 1e-5
    assert not still_trims(replace(shipped, x_ref=moved))
    assert not still_trims(replace(shipped, y_ref=shipped.y_ref * (1.0 + 1e-5)))
    controls = shipped.u_ref[shipped.valid]
    assert np.abs(controls[:, 0]).max() <= 1.0
    assert controls[:, 1].min() >= 0.0
    assert controls[:, 1].max() <= 1.0


def test_jacobians_do_not_depend_on_the_step(shipped):
    """A second step size: half the steps change no entry by more than a thousandth of its row's size."""
    aircraft = Xv15.load()
    level = shipped.level_layer
    for v, n in np.argwhere(shipped.valid[level] & _inside_corridor(shipped))[::23]:
        nacelle = float(shipped.nacelle[n])
        if nacelle < 0.02 and shipped.airspeed[v] > 87.0:
            continue  # the corners of the flap schedule have two slopes
        condition = Condition(airspeed=float(shipped.airspeed[v]), nacelle_angle=nacelle)
        trim = aircraft.trim(condition)
        half = aircraft.linearize(condition, trim, step_scale=0.5)
        for mine, other in ((shipped.A[level, v, n], half.A), (shipped.B[level, v, n], half.B)):
            size = np.abs(other).max(axis=1, keepdims=True)
            assert np.all(np.abs(mine - other) <= 2e-3 * size + 1e-9), (v, n)


def test_error_is_second_order_in_the_spacing(toy_aircraft):
    largest = []
    for points in (9, 17, 33):
        airspeed = np.linspace(24.0, 40.0, points)
        nacelle = np.radians(np.linspace(75.0, 83.0, points))
        grid = Grid(np.array([0.0]), airspeed, nacelle, np.ones((points, points), bool))
        report = check_neighbours(build_database(toy_aircraft, grid, jobs=1, edge_limit=None))
        largest.append([report.largest(axis).error for axis in ("airspeed", "nacelle")])
    ratios = np.array(largest[:-1]) / np.array(largest[1:])
    assert np.all((ratios > 3.2) & (ratios < 4.8)), ratios


def test_check_finds_a_wrong_derivative(toy_aircraft):
    """It ties the matrices to the trim map: a wrong speed derivative or nacelle derivative cannot hide."""
    points = 12
    grid = Grid(
        np.array([0.0]), np.linspace(24.0, 35.0, points), np.radians(np.linspace(75.0, 80.5, points)),
        np.ones((points, points), bool),
    )  # fmt: skip
    good = build_database(toy_aircraft, grid, jobs=1, edge_limit=None)
    A = good.A.copy()
    A[..., 4, 2] += 0.01  # M_u
    for spoilt, axis in (
        (replace(good, A=A), "airspeed"),
        (replace(good, df_dnacelle=0.7 * good.df_dnacelle), "nacelle"),
    ):
        clean = check_neighbours(good).largest(axis).error
        assert check_neighbours(spoilt).largest(axis).error > 5.0 * clean


def test_pairs_are_described(toy_database):
    report = check_neighbours(toy_database)
    text = describe(report.largest(), toy_database)
    assert " kn, " in text
    assert f"{report.largest().error:.4f}" in text
    errors = report.cell_errors("airspeed", toy_database.valid.shape[1:])
    assert np.nanmax(errors) == report.largest("airspeed").error
