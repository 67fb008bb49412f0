"""Lateral stick and pedals in flight: from every kind of pilot to the plant's inputs, over hand-overs, and replayed."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios
from rtsim.aircraft.variables import INPUT
from rtsim.arrays import FloatArray
from rtsim.command import Command, Intervention, Margins, Sensors
from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_NAMES, history_sha256
from rtsim.loop.data import CHANNEL, STATION
from rtsim.loop.script import Pulse
from rtsim.loop.setup import build_parts
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.programme import Programme
from rtsim.protection.limits import LIMIT_KINDS
from scenarios.files.options import Overrides
from scenarios.files.trial import pulses_of, trial_problems
from scenarios.files.trial_schema import PulseTable
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs
from scenarios.flight.session import FlightSession

NEW = ("lateral_stick", "pedal", "pilot_lateral_stick", "pilot_pedal", "protection_lateral_stick", "protection_pedal",
       "protection_lateral_stick_reason", "protection_pedal_reason")  # fmt: skip
OLD = [column for column, name in enumerate(SIGNAL_NAMES) if name not in NEW]
BOTH = [COLUMN.lateral_stick, COLUMN.pedal]
PILOT_BOTH = [COLUMN.pilot_lateral_stick, COLUMN.pilot_pedal]
PLUG_INS = """
import math
from rtsim.command import Command, Intervention

class Turning:
    def step(self, sensors, reference, dt):
        lateral = 0.2 * math.sin(2.0 * sensors.time)
        return Command(0.05, 0.6, 0.0, lateral, -0.5 * lateral)

class Old:
    class Answer:
        stick, lever, nacelle_rate = 0.0, 0.7, 0.0
    def step(self, sensors, reference, dt):
        return self.Answer()

class Levels:
    def step(self, sensors, command, margins, dt):
        limited = Command(command.stick, command.lever, command.nacelle_rate, 0.1 * command.lateral_stick, 0.0)
        before, after = command.lateral_stick, limited.lateral_stick
        return limited, [Intervention("flap_stop", "lateral_stick", "clip", before, after, 0.0, 1.0)]
"""


@pytest.fixture(autouse=True)
def plug_ins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "lateral_plug_ins.py").write_text(PLUG_INS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("lateral_plug_ins", None)


def hover(*pulses: Pulse, **options: Any) -> FlightSetup:
    setup = FlightSetup(programme=Programme.hold(airspeed=0.0, nacelle_angle=np.pi / 2, altitude=100.0), pulses=pulses)
    return setup.with_options(**options)


def given(simulation: Simulation, lateral: float, pedal: float, frames: int = 1) -> FloatArray:
    """Rows of frames with the hands there."""
    u = simulation.flying.state.u
    command = Command(float(u[INPUT.stick]), float(u[INPUT.lever]), 0.0, lateral, pedal)
    return np.array([simulation.step(command) for _ in range(frames)])


@pytest.mark.parametrize("law", ["off", "monitor", "full"])
def test_a_command_from_outside_reaches_the_plant_unchanged(law: str) -> None:
    """Every compiled law lets both pass to the last bit, and what acts is the plant's input."""
    simulation = Simulation(hover(protection=law))
    simulation.set_pilot("external")
    simulation.run(1)
    for lateral, pedal in ((0.123, -0.456), (-1.0, 1.0), (0.0, 0.7)):
        row = given(simulation, lateral, pedal)[0]
        fade = simulation.flying.scratch.command[STATION.aided, CHANNEL.lateral_stick] - lateral
        assert (row[COLUMN.pilot_lateral_stick], row[COLUMN.pilot_pedal]) == (lateral, pedal)
        assert fade == 0.0
        assert row[BOTH].tolist() == [lateral, pedal]
        assert simulation.flying.state.u[[INPUT.lateral_stick, INPUT.pedal]].tolist() == [lateral, pedal]
        assert not row[[COLUMN.protection_lateral_stick, COLUMN.protection_pedal_reason]].any()


def test_beyond_the_travel_is_the_stop_and_nonsense_is_refused() -> None:
    simulation = Simulation(hover())
    simulation.set_pilot("external")
    simulation.run(1)
    row = given(simulation, 1.5, -7.0)[0]
    assert row[BOTH].tolist() == [1.0, -1.0]
    assert row[PILOT_BOTH].tolist() == [1.5, -7.0]
    assert row[COLUMN.control_on_stop] == 1.0
    with pytest.raises(InputError, match="finite"):
        given(simulation, float("nan"), 0.0)


def test_the_virtual_pilot_and_old_pilots_leave_both_alone() -> None:
    straight = Simulation(hover()).run(50)
    assert not straight[:, [getattr(COLUMN, name) for name in NEW]].any()
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(pilot="lateral_plug_ins:Old", duration=0.2))
    assert flight.completed
    assert not flight["lateral_stick"].any()
    assert set(flight["pilot_lever"]) == {0.7}


def test_held_controls_stay_where_they_acted_last() -> None:
    simulation = Simulation(hover())
    simulation.set_pilot("external")
    simulation.run(1)
    given(simulation, 0.3, -0.2, 3)
    simulation.set_pilot("hold")
    assert set(map(tuple, simulation.run(20)[:, BOTH].tolist())) == {(0.3, -0.2)}
    simulation.set_pilot("hold", command=Command(0.1, 0.7, 0.0, 0.4, 0.6))
    assert set(map(tuple, simulation.run(5)[:, BOTH].tolist())) == {(0.4, 0.6)}


@pytest.mark.parametrize("to", ["mocm", "external"])
def test_who_takes_over_makes_no_step(to: str) -> None:
    """What acted fades into what the next pilot gives; the same again from a snapshot in between.

    The virtual pilot's own first output is what acted; from there his feet move no faster than 4 travels a second.
    """
    simulation = Simulation(hover())
    simulation.set_pilot("external")
    simulation.run(1)
    before = given(simulation, 0.5, -0.4)[-1, BOTH]
    simulation.set_pilot("hold")
    simulation.run(2)
    simulation.set_pilot(to)  # type: ignore[arg-type]  # one of the modes
    wanted = [0.0, 0.0] if to == "mocm" else [0.1, 0.2]

    def fly(frames: int) -> FloatArray:
        return simulation.run(frames) if to == "mocm" else given(simulation, *wanted, frames)

    rows = fly(100)
    snapshot = simulation.snapshot()
    rows = np.vstack([rows, fly(1400)])
    assert np.abs(np.diff(np.vstack([before, rows[:, BOTH]]), axis=0)).max() <= (0.017 if to == "mocm" else 0.01)
    if to == "external":
        np.testing.assert_array_equal(rows[:, PILOT_BOTH], np.tile(wanted, (1500, 1)))
    np.testing.assert_allclose(rows[-1, BOTH], wanted, atol=0.03 if to == "mocm" else 2e-3)
    simulation.restore(snapshot)
    np.testing.assert_array_equal(fly(1400), rows[100:])


@pytest.mark.parametrize("plant", ["lpv", "lpv-plain", "nonlinear"])
def test_a_script_moves_both_and_the_symmetric_flight_stays_as_it_is(plant: str) -> None:
    """Step, doublet, sine, upon what the pilot gives; an aircraft that does not roll flies as if nobody had moved."""
    pulses = (
        Pulse(channel="lateral_stick", start=0.1, duration=0.2, amount=0.3),
        Pulse(channel="pedal", start=0.1, duration=0.2, amount=1.4, shape="doublet"),
        Pulse(channel="lateral_stick", start=0.6, duration=0.2, amount=-0.2, shape="sine", period=0.1, replaces=True),
    )
    simulation = Simulation(hover(*pulses, plant=plant))
    rows = simulation.run(250)
    time, lateral, pedal = rows[:, COLUMN.time_s], rows[:, COLUMN.lateral_stick], rows[:, COLUMN.pedal]
    first = (time >= 0.1) & (time < 0.3)
    np.testing.assert_allclose(lateral[first], 0.3, atol=0.05)
    assert {1.0, -1.0} <= set(pedal[first])
    assert np.ptp(lateral[time >= 0.6]) > 0.35
    between = (time > 0.302) & (time < 0.598)  # nobody but the pilot moves them
    np.testing.assert_array_equal(rows[between][:, BOTH], np.clip(rows[between][:, PILOT_BOTH], -1.0, 1.0))
    if simulation.tables.plant.lateral == 0:
        straight = Simulation(hover(plant=plant)).run(250)
        straight[:, COLUMN.control_on_stop] = rows[:, COLUMN.control_on_stop]
        np.testing.assert_array_equal(rows[:, OLD], straight[:, OLD])


@pytest.mark.parametrize(
    ("answer", "acts"),
    [
        (lambda c: c, (0.3, -0.2)),
        (lambda c: Command(0.5 * c.stick, c.lever, c.nacelle_rate), (0.3, -0.2)),  # written before there were five
        (lambda c: dataclasses.replace(c, stick=0.0), (0.3, -0.2)),
        (lambda c: Command(c.stick, c.lever, c.nacelle_rate, 0.0, 0.0), (0.0, 0.0)),
        (lambda c: dataclasses.replace(c, pedal=5.0), (0.3, 1.0)),
    ],
)
def test_a_law_in_python_is_obeyed_where_it_says_something(
    answer: Any, acts: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Asked:
        def step(
            self, sensors: Sensors, command: Command, margins: Margins, dt: float
        ) -> tuple[Command, list[Intervention]]:
            del sensors, margins, dt
            return answer(command), []

    module = type(sys)("lateral_law")
    module.Asked = Asked  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "lateral_law", module)
    simulation = Simulation(hover(protection="lateral_law:Asked"))
    simulation.set_pilot("external")
    simulation.run(1)
    rows = given(simulation, 0.3, -0.2, 12)[5:]
    assert set(map(tuple, rows[:, BOTH].tolist())) == {acts}
    changed = np.array(acts) != (0.3, -0.2)
    reasons = rows[:, [COLUMN.protection_lateral_stick_reason, COLUMN.protection_pedal_reason]]
    np.testing.assert_array_equal(reasons != 0.0, np.tile(changed, (len(rows), 1)))
    assert set(map(tuple, rows[:, PILOT_BOTH].tolist())) == {(0.3, -0.2)}


def test_a_pilot_and_a_law_of_ones_own_are_replayed_bit_by_bit(tmp_path: Path) -> None:
    log = tmp_path / "a.parquet"
    overrides = Overrides(pilot="lateral_plug_ins:Turning", protection="lateral_plug_ins:Levels", duration=2.0)
    flight = scenarios.fly("hover", speed="max", overrides=overrides, outputs=FlightOutputs(log=log))
    assert np.ptp(flight["pilot_lateral_stick"]) > 0.3
    asked = flight["pilot_lateral_stick"][5:]
    assert 0.0 < np.abs(flight["lateral_stick"][5:]).max() < 0.11 * np.abs(asked).max()
    assert not flight["pedal"][5:].any()
    reason = 1.0 + LIMIT_KINDS.index("flap_stop")
    assert set(flight["protection_lateral_stick_reason"][5:]) == {reason}
    assert flight.summary()["interventions"]["lateral_stick_s"] > 1.9
    assert replay_log(log, trust=True).same


def test_scripts_and_hand_overs_are_replayed_bit_by_bit(tmp_path: Path) -> None:
    """A scenario's pulses; the virtual pilot gives the controls away in the middle of one, and takes them back."""
    scenario = tmp_path / "weave.toml"
    scenario.write_text(
        'format = 1\nname = "weave"\ntitle = "Weave"\nduration_s = 3\n'
        "[start]\nairspeed_kt = 0\nnacelle_deg = 90\naltitude_m = 100\n"
        "[programme]\npoints = [{ airspeed_kt = 0, nacelle_deg = 90, hold_s = 3 }]\n"
        '[[events]]\ntime_s = 1.0\naction = "pilot"\npilot = "hold"\n'
        '[[events]]\ntime_s = 1.5\naction = "pilot"\npilot = "mocm"\n'
        '[[pulses]]\nchannel = "lateral_stick"\ntime_s = 0.5\nduration_s = 0.6\namount = 0.4\nreplaces = true\n'
        '[[pulses]]\nchannel = "pedal"\ntime_s = 2.0\nduration_s = 0.6\namount = 0.4\nshape = "sine"\n',
        encoding="utf-8",
    )
    log = tmp_path / "a.parquet"
    flight = scenarios.fly(str(scenario), speed="max", outputs=FlightOutputs(log=log))
    lateral = flight["lateral_stick"]
    assert lateral[200] == 0.4
    assert np.abs(np.diff(lateral[370:500])).max() < 0.017
    assert np.ptp(flight["pedal"][500:]) > 0.1
    result = replay_log(log)
    assert result.same
    assert result.replayed_sha256 == flight.history_sha256


@pytest.mark.parametrize("lateral", [0, 1])
def test_an_aircraft_that_does_not_roll_says_so_once(lateral: int) -> None:
    setup = hover(
        Pulse(channel="pedal", start=0.1, duration=0.1, amount=0.04),
        Pulse(channel="lateral_stick", start=0.3, duration=0.1, amount=0.3),
        Pulse(channel="pedal", start=0.5, duration=0.1, amount=0.3),
    )
    parts = build_parts(setup)
    tables = parts.tables._replace(plant=parts.tables.plant._replace(lateral=lateral))
    said = []
    for runs in (False, True):
        simulation = Simulation(setup, parts=dataclasses.replace(parts, tables=tables))
        session = FlightSession(simulation, frames=200)
        events: list[Any] = []
        session.on_event = events.append
        if runs:
            rows = np.vstack([session.run(100), session.run(100)])
        else:
            rows = np.array([session.step() for _ in range(200)])
        said.append((history_sha256([rows]), [event.text for event in events if event.kind == "advice"]))
    assert said[0] == said[1]
    assert len(said[0][1]) == (0 if lateral else 1)
    assert all("does not roll or turn" in text for text in said[0][1])


@pytest.mark.parametrize(
    ("channel", "amount", "largest"),
    [("pedal", 2.5, "-2 to 2 for the pedal"), ("lateral_stick", -3.0, "lateral stick")],
)
def test_a_pulse_beyond_both_stops_is_refused(channel: str, amount: float, largest: str) -> None:
    tables = [
        PulseTable.model_validate({"channel": channel, "time_s": 0, "duration_s": 1, "amount": value})
        for value in (2.0, amount)
    ]
    problems = trial_problems(tables, None, has_events=False, flight={}, file="x.toml")
    assert [problem.key for problem in problems] == ["pulses[1].amount"]
    assert largest in str(problems[0])
    assert [pulse.amount for pulse in pulses_of(tables)] == [2.0, amount]  # as it is: no angle
