"""Flights at another weight, in other air: a small database through the path of the full one, flown and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rtsim.aircraft.condition import AircraftCondition
from rtsim.frame import COLUMN
from rtsim.loop.aircraft import told
from rtsim.lpv.building.grid import Grid, conversion_grid
from rtsim.lpv.files import kept_databases
from rtsim.lpv.files.storage import load_database
from rtsim.units import FOOT, INCH, POUND
from scenarios import fly, replay_log
from scenarios.campaign.chunks import Task, task_identity
from scenarios.files.options import Overrides
from scenarios.flight.runner import FlightOutputs

ASKED = {"mass": 11000.0 * POUND, "density_altitude": 4000.0 * FOOT, "cg_forward": 3.0 * INCH}
CONDITION = AircraftCondition(**ASKED)


def _hover_grid() -> Grid:
    """The cells around hover."""
    grid = conversion_grid()
    speeds, angles = slice(2, 8), slice(-3, None)
    return Grid(grid.layer_acceleration[1:4], grid.airspeed[speeds], grid.nacelle[angles], grid.wanted[speeds, angles])


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A cache of its own, and builds of a small grid."""
    folder = tmp_path_factory.mktemp("kept")
    own = SimpleNamespace(main_folder=lambda: folder, writable_folder=lambda: folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_databases, "store", own)
        patch.setattr("rtsim.pilot.database.conversion_grid", _hover_grid)
        patch.setattr("os.cpu_count", lambda: 1)
        yield folder


def _hover(plant: str, **changes):
    return fly("hover", speed="max", overrides=Overrides(plant=plant, duration=4.0, **{**ASKED, **changes}))


def test_it_is_built_once_flown_and_replayed(kept: Path, tmp_path: Path) -> None:
    shares: list[float] = []
    with told(lambda _, share: shares.append(share or 0.0)):
        record = fly(
            "hover",
            speed="max",
            overrides=Overrides(duration=4.0, **ASKED),
            outputs=FlightOutputs(log=tmp_path / "log.parquet"),
        )
    assert abs(sum(shares) - 1.0) < 1e-9
    assert record.completed
    database = load_database(CONDITION)
    assert set(database.pilot) == {"integrators", "pi", "lateral"}
    assert record.database_hash == database.aircraft_hash != load_database().aircraft_hash
    with told(lambda *_: pytest.fail("it was built a second time")):
        replay = replay_log(tmp_path / "log.parquet")
    assert replay.same
    assert not replay.changed_versions
    assert [path.suffix for path in sorted(kept.iterdir())] == [".lock", ".nc"]


def test_both_plants_are_the_same_aircraft(kept: Path) -> None:
    del kept
    flights = [_hover(plant).rows for plant in ("lpv", "nonlinear")]
    usual = fly("hover", speed="max", overrides=Overrides(duration=4.0)).rows
    for name, scale in (("lever", 2e-3), ("stick", 2e-3), ("pitch_deg", 0.05), ("mast_torque_inlb", 300.0)):
        column = getattr(COLUMN, name)
        np.testing.assert_allclose(flights[0][:, column], flights[1][:, column], atol=scale)
        assert abs(flights[0][0, column] - usual[0, column]) > 3.0 * scale, name
    # less is left of the engines in thin air
    available = COLUMN.engine_power_available_shp
    assert flights[0][0, available] < 0.95 * usual[0, available]


def test_a_worker_without_the_database_says_so(kept: Path) -> None:
    from rtsim.loop.options import FlightOptions

    _hover("lpv")  # built, where no test before did
    task = Task("", "", (), 0, FlightOptions(**ASKED))
    assert task_identity(task)["database"] == load_database(CONDITION).aircraft_hash
    elsewhere = replace(task, options=FlightOptions(**{**ASKED, "cg_forward": 0.0}))
    with told(lambda *_: pytest.fail("a worker was made to build")):
        assert "rtsim model build --weight-lb 11000" in task_identity(elsewhere)["database"]
    assert len(list(kept.iterdir())) == 2
