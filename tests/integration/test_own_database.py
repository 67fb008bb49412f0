"""A database of one's own in the whole loop: aircraft, pilot, laws, limits, log and replay."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import scenarios
from rtsim.cli.main import run
from rtsim.lpv.files.storage import load_database, save_database
from scenarios.campaign.chunks import Chunk, fly_chunk
from scenarios.campaign.run import CampaignOptions, identity, make_task
from scenarios.campaign.spec import load_campaign
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs
from scenarios.verdicts import tester


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped database as a file of one's own, one whose stick does less, and one without a pilot."""
    folder = tmp_path_factory.mktemp("databases")
    shipped = load_database()
    weak = shipped.B.copy()
    weak[..., [variable.name for variable in shipped.inputs].index("stick")] *= 0.9
    save_database(shipped, folder / "same.nc")
    save_database(shipped, folder / "same.mat")
    save_database(dataclasses.replace(shipped, B=weak), folder / "weak.nc")
    save_database(dataclasses.replace(shipped, pilot={}), folder / "without_pilot.nc")
    return folder


@pytest.mark.parametrize("protection", ["full", "off,full"])
@pytest.mark.parametrize("name", ["same.nc", "same.mat"])
def test_the_same_data_fly_the_same_flight(files: Path, name: str, protection: str) -> None:
    changes = {"duration": 8.0, "protection": protection, "corridor": "model"}
    shipped = scenarios.fly("typical_conversion", speed="max", overrides=Overrides(**changes))
    own = Overrides(**changes, database=str(files / name))
    flight = scenarios.fly("typical_conversion", speed="max", overrides=own)
    assert flight.history_sha256 == shipped.history_sha256
    assert flight.summary()["limits"] == shipped.summary()["limits"]


def test_another_aircraft_flies_another_flight_and_replays(files: Path, tmp_path: Path) -> None:
    overrides = Overrides(duration=8.0, database=str(files / "weak.nc"))
    log = tmp_path / "a.parquet"
    flight = scenarios.fly("typical_conversion", speed="max", overrides=overrides, outputs=FlightOutputs(log=log))
    shipped = scenarios.fly("typical_conversion", speed="max", overrides=Overrides(duration=8.0))
    assert flight.database_hash == load_database(files / "weak.nc").content_hash != shipped.database_hash
    assert np.abs(flight["stick"] - shipped["stick"]).max() > 1e-3
    assert replay_log(log).same


def test_a_trial_flies_the_database_it_is_given(files: Path) -> None:
    scenario = load_scenario("ep04_wrong_nacelle_command")
    hashes = [
        tester.Tester(law="full", **changes).run(scenario).flight.history_sha256
        for changes in ({}, {"database": str(files / "same.nc")}, {"database": str(files / "weak.nc")})
    ]
    assert hashes[0] == hashes[1]
    assert hashes[0] != hashes[2]


def test_a_campaign_flies_the_database_it_is_given(files: Path) -> None:
    spec, text = load_campaign("misuse")
    flown = []
    for changes in ({}, {"database": str(files / "same.nc")}, {"database": str(files / "weak.nc")}):
        task = make_task(spec, text, options=CampaignOptions(changes=changes), file="misuse")
        flown.append((identity(task)["database"], fly_chunk(task, Chunk(0, 0, 1)).metrics))
    assert flown[0][0] == flown[1][0] != flown[2][0]
    np.testing.assert_array_equal(flown[0][1], flown[1][1])
    assert (flown[0][1] != flown[2][1]).any()


def test_a_scenario_names_its_database_beside_it(files: Path) -> None:
    text = 'format = 1\nname = "own"\ntitle = "Own"\nduration_s = 1\n[flight]\ndatabase = "weak.nc"\n'
    (files / "own.toml").write_text(text + '[start]\ncondition = "hover"\n', encoding="utf-8")
    assert load_scenario(files / "own.toml").options.database == str((files / "weak.nc").resolve())
    assert scenarios.fly(files / "own.toml", speed="max").completed


def test_a_database_without_pilots_says_how_to_design_them(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fly = ["fly", "hover", "--headless", "--speed", "max", "--duration", "2", "--database"]
    assert run([*fly, str(files / "without_pilot.nc")]) == 2
    assert "--design-pilots" in " ".join(capsys.readouterr().err.split())
    assert run([*fly, str(files / "missing.nc")]) == 2
    assert "does not exist" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_pilots_are_designed_for_a_database_of_ones_own(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = files / "designed.nc"
    assert run(["model", "import", str(files / "without_pilot.nc"), "--design-pilots", "--out", str(target)]) == 0
    capsys.readouterr()
    overrides = Overrides(database=str(target))
    flight = scenarios.fly("typical_conversion", speed="max", overrides=overrides)
    assert flight.completed
    assert flight.held
