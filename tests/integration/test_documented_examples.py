"""What the pages tell a newcomer to copy does what they say."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import rtsim
import scenarios
from rtsim.cli.main import run
from rtsim.errors import InputError
from rtsim.realtime.control import checked_speed
from scenarios.files.options import Overrides

DOCS = Path(__file__).resolve().parents[2] / "docs"


def block(page: str, kind: str, holds: str) -> str:
    """The code block of a page that holds some words."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return next(found for found in re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) if holds in found)


def test_the_scenario_with_every_key_flies_and_holds(tmp_path: Path) -> None:
    file = tmp_path / "my_conversion.toml"
    file.write_text(block("scenarios.md", "toml", "my_conversion"), encoding="utf-8")
    flight = scenarios.fly(file, speed="max")
    assert flight.completed
    assert flight.held, flight.verdicts


def test_the_pilot_holds_the_hover(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gentle.py").write_text(block("scenarios.md", "python", "class Gentle"), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "gentle", raising=False)
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(pilot="gentle:Gentle"))
    assert flight.completed
    assert flight.metrics is not None
    assert flight.metrics.altitude_m.max_deviation < 1.0
    assert flight.metrics.airspeed_kt.max_error < 4.0


def test_the_pilot_case_is_solved_and_its_reject_refused(tmp_path: Path) -> None:
    file = tmp_path / "cases.toml"
    file.write_text(block("pilot.md", "toml", "[case.ks2.input]"), encoding="utf-8")
    assert run(["pilot", "design", str(file)]) == 0


def test_a_database_of_ones_own_is_used_as_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["model", "export", "mine.nc"]) == 0
    exec(compile(block("lpv.md", "python", "mine.nc"), "lpv.md", "exec"), {})


def test_objects_show_themselves_in_a_line() -> None:
    aircraft = rtsim.load_aircraft()
    assert len(repr(aircraft.database)) < 300
    assert len(repr(aircraft)) < 400
    assert "17 states" in repr(aircraft)
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(duration=1.0))
    assert len(repr(flight)) < 300
    assert "hover: 250 frames" in repr(flight)


def test_degrees_and_words_are_told() -> None:
    with pytest.raises(InputError, match=r"nacelle=deg\(75\)"):
        rtsim.load_aircraft().trim(airspeed=50.0, nacelle=75.0)
    with pytest.raises(InputError, match="choose a value"):
        checked_speed("fast")  # type: ignore[arg-type]
