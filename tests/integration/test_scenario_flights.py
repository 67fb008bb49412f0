"""Whole flights of the library, judged by their own expectations; every guise of one flight has one history."""

from __future__ import annotations

import math
import sys
import threading
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.frame import COLUMN
from rtsim.realtime.control import FlightControl
from rtsim.units import deg, kt
from scenarios.files.options import Overrides, chosen_scenario
from scenarios.flight.result import FlightRecord
from scenarios.flight.runner import FlightOutputs


def fast(
    name: str, *, control: FlightControl | None = None, outputs: FlightOutputs | None = None, **changes: Any
) -> FlightRecord:
    """Fly as fast as possible."""
    return scenarios.fly(name, speed="max", overrides=Overrides(**changes), control=control, outputs=outputs)


FLIGHTS = [name for name in scenarios.library_names() if not name.startswith("ep")]  # tests of protection are trials


@pytest.mark.parametrize("name", FLIGHTS)
def test_every_scenario_of_the_library_holds_what_it_expects(name: str) -> None:
    flight = fast(name)
    assert flight.completed, flight.end_reason
    assert [verdict.name for verdict in flight.verdicts if not verdict.held] == []
    assert flight.held


@pytest.mark.parametrize("changes", [{"plant": "nonlinear"}, {"outer_loop": "pi"}, {"plant": "lpv-plain"}])
def test_the_conversion_completes_in_its_other_forms(changes: dict[str, Any]) -> None:
    flight = fast("typical_conversion", **changes)
    assert flight.completed, flight.end_reason
    assert flight.metrics is not None
    assert flight.metrics.corridor.exceedances == 0
    assert flight.metrics.airspeed_kt.final == pytest.approx(170.0, abs=3.0)


def test_one_flight_in_many_guises_has_one_history(tmp_path: Path) -> None:
    """Headless, live, warped, paused, stepped, logged and recorded in pieces: bit-equal histories."""
    short = Overrides(duration=1.0)
    plain = scenarios.fly("typical_conversion", speed="max", overrides=short)
    control = FlightControl()
    control.pause()
    control.step(20)

    def resume_warped(row: FloatArray) -> None:
        if row[COLUMN.frame] == 19.0:
            threading.Timer(0.3, lambda: (control.set_speed(5.0), control.resume())).start()

    outputs = FlightOutputs(log=tmp_path / "a.parquet", on_rows=resume_warped)
    touched = scenarios.fly("typical_conversion", overrides=short, control=control, outputs=outputs)
    warped = scenarios.fly("typical_conversion", speed=20.0, overrides=short)
    assert touched.timing.paused_s > 0.1
    assert touched.failure is None
    assert {touched.history_sha256, warped.history_sha256} == {plain.history_sha256}
    assert np.array_equal(touched.rows, plain.rows)


def test_a_record_gives_signals_by_name_with_units() -> None:
    flight = fast("hover", duration=2.0)
    assert len(flight["altitude_m"]) == 500
    assert (flight.unit("altitude_m"), flight.unit("stick")) == ("m", "")
    assert "airspeed_kt" in flight
    assert flight["time_s"][-1] == pytest.approx(499 * 0.004)
    with pytest.raises(KeyError, match="altitude_m"):
        flight["altitude"]


def test_a_shortened_flight_is_not_judged() -> None:
    flight = fast("typical_conversion", duration=2.0)
    assert flight.completed
    assert flight.verdicts == ()
    assert flight.metrics is not None
    assert flight.metrics.flapping_deg.peak_after_30_s is None


def test_a_flight_stopped_by_hand_is_neither_completed_nor_failed() -> None:
    control = FlightControl()
    control.stop("enough")
    flight = fast("hover", control=control)
    assert (flight.completed, flight.end_reason, flight.held) == (False, "enough", True)
    assert flight.metrics is None
    assert flight.summary()["frames"] == 0


@pytest.mark.parametrize(
    ("name", "changes", "duration"),
    [
        (None, {"start": "cruise"}, 60.0),
        (None, {"airspeed": kt(80.0), "nacelle_angle": deg(75.0), "duration": 5.0}, 5.0),
        ("typical_conversion", {"start": "conversion"}, 39.25),
        ("hover", {"altitude": 300.0}, 120.0),
    ],
)
def test_starts(name: str | None, changes: dict[str, Any], duration: float) -> None:
    scenario = chosen_scenario(name, Overrides(**changes))
    assert scenario.duration == pytest.approx(duration)
    first = scenario.programme.at(0.0)
    assert first.airspeed == pytest.approx(scenario.start.airspeed, abs=kt(0.5))
    assert first.nacelle_angle == pytest.approx(scenario.start.nacelle_angle, abs=deg(0.5))
    assert first.altitude == scenario.start.altitude
    if "altitude" in changes:
        assert scenario.expectations
        assert scenario.start.altitude == 300.0


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("hover", {"start": "cruise"}, "does not lie on the programme of hover"),
        ("hover", {"start": "hovr"}, "'hover' is meant"),
        (None, {"start": "cruise", "airspeed": 3.0}, "given twice"),
        (None, {"airspeed": 3.0}, "--nacelle-deg: is missing"),
        (None, {"airspeed": kt(300.0), "nacelle_angle": 0.0}, "-40 to 260 kn"),
        (None, {"airspeed": 0.0, "nacelle_angle": deg(91.0)}, "0 to 90 deg"),
        ("hover", {"altitude": -1.0}, "0 to 10000 m"),
        ("hover", {"duration": 0.0}, "--duration"),
        ("hover", {"duration": math.nan}, "--duration"),
        ("hover", {"rate_hz": 20}, "50 to 1000 Hz"),
        ("hover", {"wind": kt(50.0)}, "-40 to 40 kn"),
        ("hover", {"seed": -1}, "--seed"),
        ("hover", {"pilot": "mavlink"}, "MAVLink needs a paced flight"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_sentence(name: str | None, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        scenarios.fly(chosen_scenario(name, Overrides(**changes)), speed="max")
    assert "\n" not in str(caught.value)


def test_a_start_without_trim_is_refused() -> None:
    with pytest.raises(InputError, match="trim"):
        scenarios.fly(chosen_scenario(None, Overrides(airspeed=kt(20.0), nacelle_angle=0.0)), speed="max")


OWN_PILOTS = """
import math
from rtsim.command import Command

class Steady:
    def step(self, sensors, reference, dt):
        assert dt == 0.004
        assert sensors.altitude > 0.0
        return Command(0.0, 0.5, reference.nacelle_rate)

class Failing:
    def __init__(self):
        self.frames = 0

    def step(self, sensors, reference, dt):
        self.frames += 1
        if self.frames == 300:
            raise ValueError("tired")
        return Command(0.0, 0.55, 0.0)

class Nameless:
    def step(self, sensors, reference, dt):
        return (0.0, 0.5, 0.0)

class NotFinite:
    def step(self, sensors, reference, dt):
        return Command(math.nan, 0.5, 0.0)

class Needy:
    def __init__(self, gain):
        self.gain = gain

    def step(self, sensors, reference, dt):
        return Command(0.0, 0.5, 0.0)
"""


@pytest.fixture
def plug_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The pilots above as a module of the current directory, as a user has them."""
    (tmp_path / "own_pilots.py").write_text(OWN_PILOTS, encoding="utf-8")
    (tmp_path / "broken_module.py").write_text("1 / 0\n", encoding="utf-8")
    (tmp_path / "needy_module.py").write_text("import no_such_package\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "own_pilots", raising=False)


@pytest.mark.usefixtures("plug_ins")
def test_a_pilot_of_ones_own_flies() -> None:
    flight = fast("hover", pilot="own_pilots:Steady", duration=1.0)
    assert flight.completed
    assert set(flight["pilot_mode"]) == {1.0}
    assert set(flight["pilot_lever"]) == {0.5}


@pytest.mark.usefixtures("plug_ins")
@pytest.mark.parametrize(
    ("name", "frames", "words"),
    [
        ("Failing", 300, "raised ValueError: tired"),
        ("Nameless", 1, "raised AttributeError"),
        ("NotFinite", 1, "not finite"),
    ],
)
def test_a_failing_pilot_ends_the_flight_with_a_named_reason(name: str, frames: int, words: str) -> None:
    flight = fast("hover", pilot=f"own_pilots:{name}")
    assert not flight.completed
    assert not flight.held
    assert f"own_pilots:{name}" in flight.end_reason
    assert words in flight.end_reason
    assert len(flight.rows) == frames
    assert flight["pilot_mode"][-1] == 2.0  # the last frame is flown with the controls held


@pytest.mark.usefixtures("plug_ins")
@pytest.mark.parametrize(
    ("pilot", "words"),
    [
        ("own_pilots:Stedy", "'Steady' is meant"),
        ("own_pilots:math", "no class with a method step"),
        ("own_pilots:Needy", "must take no arguments"),
        ("no_module:X", "there is no module no_module"),
        ("needy_module:X", "needs no_such_package"),
        ("broken_module:X", "ZeroDivisionError"),
        ("nobody", "allowed: mocm, mavlink, MODULE:CLASS"),
    ],
)
def test_pilots_that_do_not_exist(pilot: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        fast("hover", pilot=pilot)


def test_switching_and_resetting_in_flight_are_events() -> None:
    control = FlightControl()
    control.step(100)

    script = deque(
        [
            lambda: (control.set_pilot("hold"), control.step(100)),
            lambda: (control.reset(), control.resume()),
        ]
    )

    def next_act(_row: FloatArray) -> None:
        if script:
            script.popleft()()

    flight = fast("hover", duration=1.0, control=control, outputs=FlightOutputs(on_rows=next_act))
    assert [(event.kind, event.data.get("row")) for event in flight.events if event.kind != "end"] == [
        ("pilot", 100),
        ("reset", 200),
    ]
    assert list(flight["frame"][[99, 100, 199, 200]]) == [99.0, 100.0, 199.0, 0.0]
    assert list(flight["pilot_mode"][[99, 100, 199, 200]]) == [0.0, 2.0, 2.0, 0.0]
    assert len(flight.rows) == 450


def test_the_corridor_makes_events_unless_it_is_off(tmp_path: Path) -> None:
    path = tmp_path / "edge.toml"
    path.write_text(
        'format = 1\nname = "edge"\ntitle = "Towards the fast side"\n[programme]\nacceleration_kt_s = 2\n'
        "points = [{ airspeed_kt = 155, nacelle_deg = 30 }, { airspeed_kt = 168, nacelle_deg = 30, hold_s = 2 }]\n",
        encoding="utf-8",
    )
    watched = fast(str(path))
    levels = [event.data["level"] for event in watched.events if event.kind == "corridor"]
    assert levels[:2] == [1, 2]  # caution, then warning
    assert all(event.data["side"] == "high" for event in watched.events if event.kind == "corridor")
    unwatched = fast(str(path), protection="off")
    assert not [event for event in unwatched.events if event.kind == "corridor"]
    assert unwatched.history_sha256 == watched.history_sha256


def test_handing_over_to_a_pilot_that_is_not_there_changes_nothing() -> None:
    control = FlightControl()
    control.step(100)
    acts = deque([lambda: (control.set_pilot("external"), control.resume())])
    outputs = FlightOutputs(on_rows=lambda _row: acts.popleft()() if acts else None)
    flight = fast("hover", duration=1.0, control=control, outputs=outputs)
    assert flight.completed
    refused = next(event for event in flight.events if event.kind == "refused")
    assert refused.level == "warning"
    assert "'external' is not a pilot of this flight" in refused.text
    assert flight.history_sha256 == fast("hover", duration=1.0).history_sha256
    with pytest.raises(InputError, match="allowed: mocm, external, hold, next"):
        control.set_pilot("nobody")


def test_a_speed_in_words_is_refused() -> None:
    with pytest.raises(InputError, match="--speed: is out of range"):
        scenarios.fly("hover", speed="fast")  # type: ignore[arg-type]
