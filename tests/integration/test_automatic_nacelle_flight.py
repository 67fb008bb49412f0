"""Automatic nacelle control in flight: both ways along a schedule, replayed to the same hash, and laws of one's own."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from rtsim.command import Command
from rtsim.frame import COLUMN
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.measures.metrics import FlightFigures, measured
from rtsim.nacelle.automatic import AutomaticNacelle, ScheduledNacelle, centre_line_schedule
from rtsim.optimization.batch import BatchFlyer
from rtsim.optimization.paths import table_1
from rtsim.programme import Programme
from rtsim.units import deg, kt
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides
from scenarios.flight.flight_setup import flight_setup, setup_from_json, setup_to_json
from scenarios.flight.replay import fly_recording, replay_log
from scenarios.flight.runner import FlightOutputs, fly

ALTITUDE = 100.0


def accelerating(first_kt, last_kt, rate_kt_s, nacelle_deg):
    """A programme that says nothing of the nacelles but where they begin."""
    end = abs(last_kt - first_kt) / rate_kt_s
    time = np.array([0.0, end, end + 10.0])
    airspeed = np.array([kt(first_kt), kt(last_kt), kt(last_kt)])
    return Programme(time, airspeed, np.full(3, deg(nacelle_deg)), np.full(3, ALTITUDE))


@pytest.mark.parametrize(
    ("programme", "final_deg"),
    [(accelerating(0, 170, 3.0, 90.0), 0.0), (accelerating(170, 0, 2.0, 0.0), 90.0)],
    ids=["conversion", "reconversion"],
)
# Where the centre line is steep, 3 kn/s asks for more than 7.5 deg/s: the rate limit holds the nacelles back.
@pytest.mark.parametrize(("rate", "behind_deg"), [(7.5, 9.0), (12.0, 2.0)])
def test_the_mocm_converts_both_ways_under_automatic_control(programme, final_deg, rate, behind_deg):
    law = AutomaticNacelle(rate=deg(rate))
    simulation = Simulation(FlightSetup(programme=programme, automatic_nacelle=law))
    rows = simulation.run(round(programme.duration * 250))
    assert not simulation.finished
    assert rows[-1, COLUMN.nacelle_deg] == pytest.approx(final_deg, abs=0.1)
    assert np.abs(rows[:, COLUMN.nacelle_rate_deg_s]).max() <= rate + 1e-9
    commanded = rows[:, COLUMN.nacelle_command_rate_deg_s]
    angle = rows[:, COLUMN.nacelle_reference_deg]
    inside = (angle > 1.0) & (angle < 89.0)  # the stops end a motion at once
    assert np.abs(np.diff(commanded))[inside[1:]].max() <= 15.0 * 0.004 + 1e-9
    assert np.abs(rows[:, COLUMN.altitude_m] - ALTITUDE).max() < 4.5
    # The nacelles are where the schedule wants them at the airspeed flown.
    schedule = centre_line_schedule()  # the XV-15's, where the law has none of its own
    wanted = np.degrees([schedule.at(kt(v)) for v in rows[:, COLUMN.airspeed_kt]])
    assert np.abs(rows[:, COLUMN.nacelle_deg] - wanted).max() < behind_deg
    assert rows[:, COLUMN.margin_kt].min() > 20.0


@pytest.fixture(scope="module")
def automatic_flight(tmp_path_factory):
    log = tmp_path_factory.mktemp("log") / "flight.parquet"
    record = fly(
        "typical_conversion",
        speed="max",
        overrides=Overrides(nacelle="automatic"),
        outputs=FlightOutputs(log=log),
    )
    return record, log


def test_an_automatic_flight_replays_to_its_hash(automatic_flight):
    record, log = automatic_flight
    assert record.completed
    result = replay_log(log)
    assert result.same
    assert result.replayed_sha256 == record.history_sha256


def test_steps_runs_batches_and_snapshots_agree(automatic_flight):
    record, _ = automatic_flight
    setup = flight_setup(record.scenario)
    assert setup_from_json(setup_to_json(setup)).automatic_nacelle == setup.automatic_nacelle
    simulation = Simulation(setup)
    first = np.array([simulation.step() for _ in range(2500)])
    snapshot = simulation.snapshot()
    rest = simulation.run(len(record.rows) - 2500)
    assert np.array_equal(np.concatenate((first, rest)), record.rows)
    simulation.restore(snapshot)
    assert np.array_equal(simulation.run(len(rest)), rest)
    batch = BatchFlyer(setup, workers=1).fly([setup.programme])[0]
    assert batch == FlightFigures(measured(record.rows, setup.programme, simulation.dt))


def test_the_law_sets_the_nacelles_whoever_flies():
    programme = accelerating(90, 110, 2.0, 75.0)
    setup = FlightSetup(programme=programme, automatic_nacelle=AutomaticNacelle()).with_options(pilot="external")
    simulation = Simulation(setup)
    for _ in range(500):
        row = simulation.step(dataclasses.replace(simulation.pilot_command(), nacelle_rate=deg(7.0)))
    assert row[COLUMN.nacelle_deg] < 75.0
    assert row[COLUMN.pilot_nacelle_rate_rad_s] == deg(7.0)


class Centre(ScheduledNacelle):
    """The built-in law as a plug-in."""


class FailsAtTenSeconds:
    """A law that raises on the way."""

    def step(self, sensors, command, dt):  # noqa: ARG002 - the interface's
        """Fail at 10 s."""
        if sensors.time >= 10.0:
            raise LookupError("no schedule left")
        return 0.0


def test_a_law_of_ones_own_flies_and_replays(tmp_path, automatic_flight):
    log = tmp_path / "own.parquet"
    record = fly(
        "typical_conversion",
        speed="max",
        overrides=Overrides(nacelle=f"{__name__}:Centre"),
        outputs=FlightOutputs(log=log),
    )
    # The plug-in sees the sensors in SI, the built-in law the frame's own numbers: the same to rounding.
    assert np.abs(record.rows[:, COLUMN.nacelle_deg] - automatic_flight[0].rows[:, COLUMN.nacelle_deg]).max() < 1e-6
    assert replay_log(log).same


def test_a_law_that_fails_is_reported_and_the_flight_goes_on():
    record = fly("typical_conversion", speed="max", overrides=Overrides(nacelle=f"{__name__}:FailsAtTenSeconds"))
    assert record.completed
    events = [event for event in record.events if event.kind == "nacelle_law_failed"]
    assert len(events) == 1
    assert events[0].frame == 2500
    assert "LookupError: no schedule left" in events[0].text
    assert record.rows[2400, COLUMN.nacelle_deg] == pytest.approx(90.0)
    assert record.rows[-1, COLUMN.nacelle_deg] == pytest.approx(0.0, abs=0.1)


def test_the_law_of_the_documentation_flies(tmp_path, monkeypatch):
    page = (Path(__file__).resolve().parents[2] / "docs" / "nacelle.md").read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[-1]
    (tmp_path / "my_nacelles.py").write_text(code, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    record = fly("typical_conversion", speed="max", overrides=Overrides(nacelle="my_nacelles:StraightLine"))
    assert record.completed
    assert not [event for event in record.events if event.kind == "nacelle_law_failed"]
    assert record.rows[-1, COLUMN.nacelle_deg] == pytest.approx(0.0, abs=0.1)
    assert np.abs(record.rows[:, COLUMN.nacelle_rate_deg_s]).max() < 5.01


def test_what_the_automatic_control_gains_over_table_1():
    programme = table_1().programme()
    plain = BatchFlyer(FlightSetup(programme=programme), workers=1).fly([programme])[0]
    law = AutomaticNacelle(schedule=centre_line_schedule())
    automatic = BatchFlyer(FlightSetup(programme=programme, automatic_nacelle=law), workers=1).fly([programme])[0]
    assert automatic.flapping_integral_deg_s < 0.85 * plain.flapping_integral_deg_s
    assert automatic.worst_margin_kt > plain.worst_margin_kt + 10.0


def test_recorded_commands_fly_again_without_the_law():
    """Replay gives the recorded nacelle rate of a plug-in back; the law itself is not needed."""
    setup = flight_setup(load_scenario("typical_conversion"))
    simulation, law = Simulation(setup), ScheduledNacelle()
    rows = []
    for _ in range(1000):
        command = simulation.pilot_command()
        rate = law.step(simulation.sensors(), command, simulation.dt)
        rows.append(simulation.step(Command(command.stick, command.lever, rate)))
    again = fly_recording(Simulation(setup), np.array(rows), [])
    assert np.array_equal(again, np.array(rows))
