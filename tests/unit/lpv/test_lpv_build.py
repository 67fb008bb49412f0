"""The builder: continuation on the unstalled branch, marking, independence of the number of processes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from rtsim.errors import TrimError
from rtsim.lpv.building.build import GridPoint, build_database
from rtsim.lpv.building.checks import check_neighbours
from rtsim.lpv.building.grid import AIRSPEED_KT, NACELLE_DEG, Grid, conversion_grid
from rtsim.lpv.building.xv15_grid import Xv15Grid, source_sha256
from rtsim.units import deg, kt


def test_trims_are_trims(toy_aircraft, toy_database):
    d = toy_database
    assert d.valid[1].sum() > 80
    for layer, v, n in np.argwhere(d.valid):
        x, u = d.x_ref[layer, v, n], d.u_ref[layer, v, n]
        pitch = x[1]
        rate = toy_aircraft.derivative(x, u, d.nacelle[n])
        wanted = np.zeros(8)
        wanted[2:4] = d.layer_acceleration[layer] * np.cos(pitch), d.layer_acceleration[layer] * np.sin(pitch)
        np.testing.assert_allclose(rate, wanted, atol=1e-7)
        assert abs(x[2] * np.cos(pitch) + x[3] * np.sin(pitch) - d.airspeed[v]) < 1e-9
        assert toy_aircraft.reject(GridPoint(x, u, d.y_ref[layer, v, n], rate), 0.0, 0.0) is None


def test_jacobians_belong_to_their_cells(toy_aircraft, toy_database):
    d = toy_database
    for layer, v, n in np.argwhere(d.valid)[::17]:
        x, u, nacelle = d.x_ref[layer, v, n], d.u_ref[layer, v, n], d.nacelle[n]
        rng = np.random.default_rng(int(v))
        dx, du = 1e-5 * rng.normal(size=8), 1e-5 * rng.normal(size=7)
        change = toy_aircraft.derivative(x + dx, u + du, nacelle) - toy_aircraft.derivative(x, u, nacelle)
        np.testing.assert_allclose(d.A[layer, v, n] @ dx + d.B[layer, v, n] @ du, change, rtol=1e-3, atol=1e-7)


@dataclass(frozen=True)
class FoldingAircraft:
    """Wraps the toy: below a fold airspeed its solver gives the other, stalled branch."""

    toy: object
    fold: float

    def __getattr__(self, name):
        return getattr(self.toy, name)

    def solve(self, airspeed, nacelle, acceleration, guess):
        point = self.toy.solve(airspeed, nacelle, acceleration, guess)
        if point is None or airspeed > self.fold or nacelle > 1.2:
            return point
        x = point.x.copy()
        x[1] += 0.5  # half a radian of pitch more, as deep stall has
        return replace(point, x=x)


def test_other_branch_is_not_taken(toy_aircraft, toy_grid):
    database = build_database(FoldingAircraft(toy_aircraft, 41.0), toy_grid, jobs=1, edge_limit=None)
    slow = toy_grid.airspeed < 41.0
    airplane = toy_grid.nacelle < deg(69.0)
    assert not database.valid[1][np.ix_(slow, airplane)].any()
    assert database.valid[1][np.ix_(~slow, airplane)].all()
    # and what stands there comes from the nearest valid airspeed of the same nacelle angle
    first = int(np.argmax(~slow))
    for v in np.flatnonzero(slow):
        assert database.A[1, v, 0].tobytes() == database.A[1, first, 0].tobytes()


def test_only_wanted_cells_are_solved(toy_aircraft, toy_grid):
    wanted = toy_grid.wanted & (toy_grid.airspeed[:, None] < 51.0)
    database = build_database(toy_aircraft, replace(toy_grid, wanted=wanted), jobs=1, edge_limit=None)
    assert not database.valid[:, ~wanted].any()


def test_no_start_is_told(toy_aircraft, toy_grid):
    with pytest.raises(TrimError, match="there is no trim to start from at nacelle 90 deg"):
        build_database(FoldingAircraft(_Hopeless(toy_aircraft), 0.0), toy_grid, jobs=1)


def test_trims_begin_where_there_is_one_nearest_to_hover(toy_aircraft, toy_grid, toy_database):
    """Too heavy to hover: the slow cells are invalid, the others as they would be."""
    heavy = _TooHeavy(toy_aircraft, 12.0)
    database = build_database(heavy, toy_grid, jobs=1, edge_limit=None)
    slow = np.abs(toy_grid.airspeed) < heavy.slowest
    assert slow.any()
    assert not database.valid[:, slow].any()
    both = database.valid & toy_database.valid
    assert both[database.level_layer].sum() > 0.5 * toy_database.valid[database.level_layer].sum()
    np.testing.assert_allclose(database.x_ref[both], toy_database.x_ref[both], atol=1e-6)


@dataclass(frozen=True)
class _TooHeavy:
    toy: object
    slowest: float

    def __getattr__(self, name):
        return getattr(self.toy, name)

    def solve(self, airspeed, *rest):
        return None if abs(airspeed) < self.slowest else self.toy.solve(airspeed, *rest)


@dataclass(frozen=True)
class _Hopeless:
    toy: object

    def __getattr__(self, name):
        return getattr(self.toy, name)

    def solve(self, *_where):
        return None


def test_edge_that_fails_the_check_is_drawn_in(toy_aircraft):
    """With fine spacing only the edge may fail; what is left passes, and only edges went."""
    grid = Grid(
        np.array([0.0]), np.arange(20.0, 60.1, 1.0), np.radians([75.0, 80.0, 85.0, 90.0]), np.ones((41, 4), bool)
    )
    whole = build_database(toy_aircraft, grid, jobs=1, edge_limit=None)
    errors = sorted(e.error for e in check_neighbours(whole).errors)
    limit = errors[-4]
    drawn_in = build_database(toy_aircraft, grid, jobs=1, edge_limit=limit)
    assert drawn_in.valid.sum() <= whole.valid.sum()
    assert not (drawn_in.valid & ~whole.valid).any()
    for e in check_neighbours(drawn_in).above(limit):
        for v, n in (e.start, e.end):
            assert drawn_in.valid[0, max(v - 1, 0) : v + 2, n].all()  # not an edge


def test_progress_adds_up_to_one(toy_aircraft, toy_grid):
    shares = []
    build_database(toy_aircraft, toy_grid, jobs=1, progress=shares.append, edge_limit=None)
    assert len(shares) > 5
    assert sum(shares) == pytest.approx(1.0)


def test_grid_has_what_flights_need():
    grid = conversion_grid()
    for airspeed in (-20.0, 0.0, 60.0, 130.0, 170.0, 180.0, 260.0):
        assert airspeed in AIRSPEED_KT
    assert np.all(np.diff(AIRSPEED_KT[AIRSPEED_KT <= 60]) <= 5.0)
    assert np.all(np.diff(AIRSPEED_KT[(AIRSPEED_KT >= 60) & (AIRSPEED_KT <= 130)]) <= 8.0)
    assert np.all(np.diff(AIRSPEED_KT) <= 10.0)
    assert np.all(np.diff(NACELLE_DEG[NACELLE_DEG >= 60]) <= 2.5)
    assert grid.wanted[grid.airspeed == kt(0.0), grid.nacelle == deg(90.0)].all()
    assert grid.wanted[AIRSPEED_KT == 260.0, 0].all()
    assert not grid.wanted[AIRSPEED_KT == 0.0, 5].any()


def test_number_of_processes_does_not_matter():
    """A patch of the real grid on either side of the seam, in one process and in two."""
    rows, speeds = [17, 18, 19], slice(8, 16)
    grid = conversion_grid()
    patch = Grid(grid.layer_acceleration[[2, 4]], grid.airspeed[speeds], grid.nacelle[rows], np.ones((8, 3), bool))
    hashes = {build_database(Xv15Grid(), patch, jobs=jobs).content_hash for jobs in (1, 2)}
    assert len(hashes) == 1


def test_flap_corner_has_the_slope_of_the_slower_side():
    """At 170 kn on the downstop the flaps begin to retract; the database keeps the derivatives of flight below."""
    source = Xv15Grid()
    points = [source.solve(kt(speed), 0.0, 0.0, None) for speed in (169.0, 170.0)]
    slopes = [
        source.jacobians(point, kt(speed), 0.0, 0.0)[0] for point, speed in zip(points, (169.0, 170.0), strict=True)
    ]
    row = [variable.name for variable in source.states].index("w")
    np.testing.assert_allclose(slopes[1][row, :2], slopes[0][row, :2], rtol=0.02)
    beyond = source.jacobians(source.solve(kt(172.0), 0.0, 0.0, None), kt(172.0), 0.0, 0.0)[0]
    assert abs(beyond[row, 0] - slopes[0][row, 0]) > 0.2 * abs(slopes[0][row, 0])


def test_source_hash_ignores_comments_and_sees_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr("rtsim.lpv.building.xv15_grid.MODEL_DATA", tmp_path)
    monkeypatch.setattr("rtsim.lpv.building.xv15_grid.MODEL_FILES", ("a.toml",))
    hashes = []
    for text in ("x = 1.0\n", "# source\nx  = 1.0\n", "x = 1.1\n", "y = 1.0\n"):
        (tmp_path / "a.toml").write_text(text)
        hashes.append(source_sha256())
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 3
