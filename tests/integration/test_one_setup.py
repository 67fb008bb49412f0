"""One setup, one flight: every setting acts in every command, and who watches changes nothing."""

from __future__ import annotations

import json
import shutil
import socket
from pathlib import Path

import numpy as np
import pytest

import scenarios
from rtsim.cli.main import run
from rtsim.command import Command
from rtsim.frame import COLUMN
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.lpv.files.storage import SHIPPED
from rtsim.measures.metrics import FlightFigures, measured
from rtsim.optimization.batch import BatchFlight, BatchFlyer
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides
from scenarios.flight.mavlink_options import MavlinkOptions
from scenarios.flight.runner import FlightOutputs, fly
from scenarios.verdicts import tester

TRIAL = """
format = 1
name = "mine"
title = "A forward switch at 60 kn"
duration_s = 6
[flight]
database = "aircraft/mine.nc"
[start]
airspeed_kt = 60
nacelle_deg = 82
[programme]
points = [{ airspeed_kt = 60, nacelle_deg = 82, hold_s = 6 }]
[trial]
kind = "nominal"
[[trial.expect]]
name = "cannot be"
metric = "exceedances"
min = 5
"""


class Plugged:
    """A pilot that counts how often it is asked."""

    calls = 0

    def step(self, sensors, reference, dt):  # noqa: ARG002
        Plugged.calls += 1
        return Command(0.02 * np.sin(sensors.time), 0.7, 0.0)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with a trial that names a database beside it."""
    (tmp_path / "aircraft").mkdir()
    shutil.copyfile(SHIPPED, tmp_path / "aircraft" / "mine.nc")
    (tmp_path / "mine.toml").write_text(TRIAL, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def nobody() -> MavlinkOptions:
    """A ground station's address where nobody answers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return MavlinkOptions(targets=(f"127.0.0.1:{free.getsockname()[1]}",))


@pytest.mark.parametrize(
    ("scenario", "changes"),
    [
        ("ep04_wrong_nacelle_command", {}),  # scripted pulses
        ("ep04_wrong_nacelle_command", {"nacelle": "automatic"}),
        ("hover", {"pilot": f"{__name__}:Plugged"}),
    ],
)
def test_a_station_that_only_watches_changes_nothing(scenario, changes):
    """faults.md A3: MAVLink dropped a script's pulses and replaced a pilot plug-in."""
    overrides = Overrides(duration=4.0, **changes)
    alone = fly(scenario, speed=16.0, overrides=overrides)
    asked, Plugged.calls = Plugged.calls, 0
    watched = fly(scenario, speed=16.0, overrides=overrides, outputs=FlightOutputs(mavlink=nobody()))
    assert watched.history_sha256 == alone.history_sha256
    assert Plugged.calls == asked
    if "pilot" in changes:
        assert asked == 1000


def test_controls_given_to_nobody_are_held_in_every_way_of_flying():
    """faults.md A4: in a batch the mode ``external`` flew stick 0 and lever 0, elsewhere it holds the trim."""
    programme = load_scenario("hover").programme
    setup = FlightSetup(programme=programme).with_options(pilot="external")
    rows = Simulation(setup).run(500)
    assert np.ptp(rows[:, COLUMN.lever]) == 0.0
    assert rows[0, COLUMN.lever] > 0.5
    batch = BatchFlyer(setup).fly_one(BatchFlight(programme, duration=2.0))
    alone = FlightFigures(measured(rows, programme, 0.004))
    for name in FlightFigures.shown:
        assert float(batch[name]) == pytest.approx(float(alone[name]), abs=1e-9, nan_ok=True), name


def test_a_missing_database_is_refused_before_anything_flies(own, capsys):
    """faults.md A1: a scenario whose database does not exist was judged all the same."""
    (own / "aircraft" / "mine.nc").unlink()
    for command in (
        ["test", "mine.toml"],
        ["fly", "mine.toml", "--headless", "--speed", "max"],
        ["check", "mine.toml"],
    ):
        assert run(command) == 2
        told = "".join(capsys.readouterr())
        assert "flight.database" in told
        assert "mine.nc" in told
        assert "trim" not in told


def test_a_bundle_is_complete(own, tmp_path_factory, capsys):
    """faults.md A2: bundles kept a relative path to a database and not the file."""
    assert run(["test", "mine.toml", "--out", "bundles", "--json"]) == 1
    elsewhere = tmp_path_factory.mktemp("moved") / "mine"
    shutil.move(own / "bundles" / "mine", elsewhere)
    shutil.rmtree(own / "aircraft")
    capsys.readouterr()
    assert run(["check", str(elsewhere / "scenario.toml")]) == 0
    assert run(["replay", str(elsewhere / "law.parquet")]) == 0
    verdict = json.loads((elsewhere / "verdict.json").read_text(encoding="utf-8"))
    again = tester.Tester(law="full").run(load_scenario(elsewhere / "scenario.toml"))
    assert again.flight.history_sha256 == verdict["history_sha256"]
    assert verdict["replay"][0] == "rtsim test scenario.toml --protection full"


def test_a_bundle_tells_what_the_command_line_changed(own):
    text = Path("mine.toml").read_text(encoding="utf-8").replace('database = "aircraft/mine.nc"', "rate_hz = 200")
    Path("mine.toml").write_text(text, encoding="utf-8")
    assert run(["test", "mine.toml", "--out", "b", "--rate", "100", "--database", "aircraft/mine.nc", "--json"]) == 1
    verdict = json.loads(Path("b/mine/verdict.json").read_text(encoding="utf-8"))
    assert verdict["replay"][0] == "rtsim test scenario.toml --protection full --database mine.nc --rate 100"
    assert Path("b/mine/mine.nc").is_file()
    assert own


@pytest.mark.parametrize("name", ["conversion_8deg", "hover", "typical_conversion"])
def test_a_flight_is_tested_by_the_corridor_it_is_flown_in(name):
    """faults.md A6: the documented test of the library failed where the flight holds all it is asked."""
    flown = scenarios.fly(name, speed="max")
    case = tester.Tester().run(load_scenario(name))
    assert case.scenario.options.corridor_name == flown.scenario.options.corridor_name
    assert case.flight.history_sha256 == flown.history_sha256
    assert case.verdict == "passed"
