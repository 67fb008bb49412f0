"""Flaps by hand and rotors without their governor in the closed loop: live, in scenarios, in snapshots and replays."""

from __future__ import annotations

import dataclasses
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios
from rtsim.aircraft.variables import AUXILIARY_INPUTS
from rtsim.arrays import FloatArray
from rtsim.command import Command
from rtsim.errors import InputError
from rtsim.faults.fault import Fault
from rtsim.frame import COLUMN, history_sha256
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.lpv.database import Database
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.programme import Programme
from rtsim.realtime.control import FlightControl
from rtsim.realtime.keys import press
from rtsim.units import deg, kt
from scenarios.campaign.trial import Bench
from scenarios.files.loader import load_scenario
from scenarios.files.options import Overrides
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs
from scenarios.verdicts.tester import plan_of
from telemetry.mavlink.notices import TEXT_LENGTH

PLANTS = ["lpv", "lpv-plain", "nonlinear"]


def hold(airspeed: float, nacelle: float, altitude: float = 100.0, **changes: Any) -> FlightSetup:
    programme = Programme.hold(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), altitude=altitude)
    faults = changes.pop("faults", ())
    return FlightSetup(programme=programme, faults=faults).with_options(**changes)


@pytest.mark.parametrize("plant", PLANTS)
def test_switched_in_flight_it_is_the_same_however_it_is_flown(plant: str) -> None:
    """Frame by frame, in blocks, and from a snapshot taken while flaps and rotors are on their way."""

    def switch(simulation: Simulation) -> None:
        simulation.set_flaps(deg(20.0))
        simulation.set_aid("governor", False)
        simulation.set_throttle_trim(0.01)

    simulation = Simulation(hold(60, 75, plant=plant))
    simulation.run(50)
    switch(simulation)
    stepped = np.array([simulation.step() for _ in range(500)])
    assert 20.0 < stepped[-1, COLUMN.flap_deg] < 40.0
    assert stepped[-1, COLUMN.rotor_speed_rpm] != 589.0
    simulation.reset()
    assert set(simulation.aids) == {"automatic_flaps", "governor"}
    simulation.run(50)
    switch(simulation)
    pieces = [simulation.run(77)]
    snapshot = simulation.snapshot()
    pieces.append(simulation.run(423))
    assert history_sha256([stepped]) == history_sha256(pieces)
    simulation.restore(snapshot)
    np.testing.assert_array_equal(simulation.run(423), pieces[1])


@pytest.mark.parametrize("plant", PLANTS)
def test_all_on_is_the_flight_without_flap_and_rotor_inputs(plant: str) -> None:
    """Switched off and on again in the same frame nothing has changed, to the last bit."""
    simulation = Simulation(hold(80, 75, plant=plant))
    untouched = simulation.run(100)
    simulation.reset()
    for name in ("automatic_flaps", "governor"):
        simulation.set_aid(name, False)  # type: ignore[arg-type]
        simulation.set_aid(name, True)  # type: ignore[arg-type]
    assert history_sha256([simulation.run(100)]) == history_sha256([untouched])


def test_flaps_left_to_themselves_stay_out_where_the_schedule_takes_them_in() -> None:
    """From 165 to 200 kn on the downstop the schedule goes from 40 to 0 deg; by hand they stay at 40."""
    programme = Programme(np.array([0.0, 14.0]), kt(np.array([165.0, 200.0])), np.zeros(2), np.full(2, 500.0))
    flaps = {}
    for automatic in (True, False):
        rows = Simulation(FlightSetup(programme=programme).with_options(automatic_flaps=automatic)).run(18 * 250)
        flaps[automatic] = rows[:, COLUMN.flap_deg]
        assert rows[-1, COLUMN.airspeed_kt] > 195.0
    assert flaps[True][-1] == 0.0
    assert np.all(flaps[False] == 40.0)


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_an_engine_fails_without_the_governor(plant: str) -> None:
    """One engine at contingency rating does not carry the hover: the rotors slow until the flight ends.

    With the governor on the same failure keeps the rotor speed and takes the collective.
    """
    fault = Fault(kind="engine-limit", start=0.5, power=0.0)
    slowest = {}
    for governor in (True, False):
        simulation = Simulation(hold(0, 90, plant=plant, faults=(fault,), governor=governor, altitude=1000.0))
        rows = simulation.run(15 * 250)
        late = rows[rows[:, COLUMN.time_s] > 2.5]
        assert np.all(late[:, COLUMN.engine_power_shp] < 1802.0 * 1.01)
        slowest[governor] = rows[:, COLUMN.rotor_speed_rpm].min()
        assert simulation.end_reason.startswith("rotor speed below 80 %") == (not governor)
    assert slowest[True] == pytest.approx(589.0, abs=1e-9)
    assert slowest[False] < 480.0


def test_the_end_says_which_way_the_rotor_speed_left_and_fits_a_statustext() -> None:
    ends = {}
    for trim in (-0.5, 0.5):
        simulation = Simulation(hold(0, 90, governor=False, altitude=1000.0))
        simulation.set_throttle_trim(trim)
        simulation.run(10 * 250)
        ends[trim] = simulation.end_reason
        assert len(simulation.end_reason) <= TEXT_LENGTH
    drive = simulation.tables.drive
    assert ends[-0.5].startswith(f"rotor speed below {100.0 * drive.lowest / drive.governed_speed:.0f} %")
    assert ends[0.5].startswith(f"rotor speed above {100.0 * drive.highest / drive.governed_speed:.0f} %")


@pytest.mark.parametrize("plant", ["lpv", "nonlinear"])
def test_a_governor_back_on_takes_collective_to_bring_the_rotors_back(plant: str) -> None:
    """One engine, too much lever: without the governor the rotors slow down, with it again they come back to speed."""
    fault = Fault(kind="engine-limit", start=0.0, power=0.0, other_engine="normal")
    simulation = Simulation(hold(60, 75, plant=plant, faults=(fault,), governor=False, pilot="external"))
    start = simulation.pilot_command()
    command = Command(start.stick, start.lever + 0.15, 0.0)
    rows = [simulation.step(command) for _ in range(4 * 250)]
    assert rows[-1][COLUMN.rotor_speed_rpm] < 560.0
    low = rows[-1][COLUMN.collective_75_deg]
    simulation.set_aid("governor", True)
    rows = [simulation.step(command) for _ in range(6 * 250)]
    assert rows[-1][COLUMN.rotor_speed_rpm] > 587.0
    assert rows[-1][COLUMN.collective_75_deg] < low


def test_a_governor_back_on_holds_windmilling_rotors() -> None:
    """In airplane mode with the lever back: off its speed a governed rotor runs away no more than on it."""
    simulation = Simulation(hold(180, 0, plant="nonlinear", pilot="external", governor=False))
    start = simulation.pilot_command()
    for frame in range(3 * 250):
        if frame == 25:
            simulation.set_aid("governor", True)
        row = simulation.step(Command(start.stick, start.lever - 0.5 * min(frame / 250.0, 1.0), 0.0))
    assert not simulation.finished
    assert row[COLUMN.engine_power_shp] < 0.0
    assert row[COLUMN.rotor_speed_rpm] < 592.0


def test_the_rotor_answers_lever_and_throttle_trim_the_right_way() -> None:
    """More collective than the throttle brings power slows the rotors; a throttle trim alone speeds them up."""
    change = {}
    for name, lever, trim in (("nothing", 0.0, 0.0), ("lever", 0.03, 0.0), ("trim", 0.0, 0.03)):
        simulation = Simulation(hold(0, 90, pilot="external", governor=False))
        start = simulation.pilot_command()
        simulation.set_throttle_trim(trim)
        rows = [simulation.step(Command(start.stick, start.lever + lever, 0.0)) for _ in range(500)]
        change[name] = rows[-1][COLUMN.rotor_speed_rpm] - 589.0
    assert abs(change["nothing"]) < 0.2
    assert change["lever"] < -1.0
    assert change["trim"] > 1.0


def test_keys_and_control_switch_live_and_the_log_replays(tmp_path: Path) -> None:
    control = FlightControl()
    control.step(100)
    keys = deque(["v", "g", "t", "b", "u"])

    def next_act(_row: FloatArray) -> None:
        if keys:
            press(control, keys.popleft())
            if len(keys) == 3:
                control.trim_throttle(0.02)
                control.switch_aid("no_such_aid")
                control.set_flaps(9.0)
            control.step(100)
        else:
            control.resume()

    outputs = FlightOutputs(log=tmp_path / "a.parquet", on_rows=next_act)
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(duration=3.0), control=control, outputs=outputs)
    assert [event.kind for event in flight.events if event.kind in {"aid", "flaps", "throttle", "refused"}] == [
        *("flaps", "aid", "throttle", "refused", "refused", "aid", "flaps", "aid"),
    ]
    assert flight["flap_deg"].max() > 41.0
    assert np.ptp(flight["rotor_speed_rpm"]) > 0.1
    assert replay_log(tmp_path / "a.parquet").same


def test_a_scenario_starts_without_them(tmp_path: Path) -> None:
    text = (
        'format = 1\nname = "own"\ntitle = "Own"\nduration_s = 1\n[flight]\nautomatic_flaps = false\ngovernor = false\n'
    )
    (tmp_path / "own.toml").write_text(text + '[start]\ncondition = "hover"\n', encoding="utf-8")
    scenario = load_scenario(tmp_path / "own.toml")
    assert (scenario.options.automatic_flaps, scenario.options.governor) == (False, False)
    assert scenarios.fly(tmp_path / "own.toml", speed="max").completed


@pytest.mark.parametrize("on", [True, False])
def test_a_trial_flies_with_the_flaps_and_rotors_of_its_scenario(tmp_path: Path, on: bool) -> None:
    """A test of protection is flown on a bench; here from 170 to 185 kn, where the schedule takes the flaps in."""
    switches = f"[flight]\nautomatic_flaps = {str(on).lower()}\ngovernor = {str(on).lower()}\n\n[start]\n"
    text = load_scenario("ep07_deceleration_airplane").source.replace("[start]\n", switches, 1)
    for old, new in (
        ("_deg = 5\n", "_deg = 0\n"),
        ("_deg = 5,", "_deg = 0,"),
        ("_kt = 150", "_kt = 170"),
        ("85", "185"),
    ):
        text = text.replace(old, new)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    plan = replace(plan_of(load_scenario(tmp_path / "own.toml")), duration=6.0)
    rows = Bench().fly(plan, "off", keep=True).rows
    assert (np.ptp(rows[:, COLUMN.flap_deg]) == 0.0) == (not on)
    assert (np.ptp(rows[:, COLUMN.rotor_speed_rpm]) == 0.0) == on


def without_inputs(database: Database, names: tuple[str, ...]) -> Database:
    keep = [i for i, variable in enumerate(database.inputs) if variable.name not in names]
    return dataclasses.replace(
        database,
        inputs=tuple(database.inputs[i] for i in keep),
        u_ref=database.u_ref[..., keep],
        B=database.B[..., keep],
        D=database.D[..., keep],
        lateral=None,
    )


def test_a_database_without_these_inputs_flies_but_needs_both(tmp_path: Path) -> None:
    file = tmp_path / "seven.nc"
    save_database(without_inputs(load_database(), AUXILIARY_INPUTS), file)
    mine = Simulation(hold(60, 75, database=str(file)))
    assert history_sha256([mine.run(250)]) == history_sha256([Simulation(hold(60, 75)).run(250)])
    for name in ("automatic_flaps", "governor"):
        with pytest.raises(InputError, match=f"{name}: cannot be switched off: the database does not say"):
            mine.set_aid(name, False)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="the database does not say"):
        mine.set_flaps(0.0)
    with pytest.raises(InputError, match="the database does not say"):
        Simulation(hold(60, 75, database=str(file), governor=False))
    Simulation(hold(60, 75, database=str(file), governor=False, plant="nonlinear"))


def test_a_database_with_other_variables_cannot_be_flown(tmp_path: Path) -> None:
    file = tmp_path / "other.nc"
    save_database(without_inputs(load_database(), ("gust_q",)), file)
    with pytest.raises(InputError, match=r"other\.nc.*needs .gust_q. \[rad/s\], which the database lacks"):
        Simulation(hold(60, 75, database=str(file)))
    shipped = load_database()
    states = (dataclasses.replace(shipped.states[0], unit="kn"), *shipped.states[1:])
    save_database(dataclasses.replace(shipped, states=states), file)
    with pytest.raises(InputError, match=r"'u' is in another unit.*got 'kn'.*m/s"):
        Simulation(hold(60, 75, database=str(file)))


def test_the_flap_switch_goes_from_setting_to_setting_and_to_the_ends() -> None:
    simulation = Simulation(hold(0, 90))
    assert [simulation.next_flap_setting(step) for step in (1, -1)] == [deg(75.0), deg(20.0)]
    simulation.set_flaps(deg(75.0))
    simulation.run(8 * 250)
    simulation.set_aid("automatic_flaps", True)
    simulation.run(3)
    assert simulation.next_flap_setting(1) == deg(75.0)  # on their way back, hardly off the end
    simulation.set_flaps(deg(0.2))
    assert simulation.next_flap_setting(-1) == 0.0


def test_settings_out_of_range_are_refused() -> None:
    simulation = Simulation(hold(0, 90))
    with pytest.raises(InputError, match="outside the travel of the flaps"):
        simulation.set_flaps(deg(76.0))
    with pytest.raises(InputError, match="is out of range"):
        simulation.set_throttle_trim(0.6)
    assert set(simulation.aids) == {"automatic_flaps", "governor"}
