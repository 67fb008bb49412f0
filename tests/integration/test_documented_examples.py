"""What the pages tell a newcomer to copy does what they say."""

from __future__ import annotations

import re
import runpy
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

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


def test_the_pilot_of_a_plant_of_ones_own_is_designed() -> None:
    names: dict[str, Any] = {}
    exec(compile(block("pilot.md", "python", "rtsim.design_mocm"), "pilot.md", "exec"), names)
    assert names["pilot"].statistics.rms_y[0] > 0.0
    assert names["pilot"].margins().phase_margin[0] > 0.0


def test_a_database_of_ones_own_is_used_as_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["model", "export", "mine.nc"]) == 0
    exec(compile(block("lpv.md", "python", "mine.nc"), "lpv.md", "exec"), {})


NAMED = re.compile(r"`([a-z_]+\.(?:toml|py))`[^`]*\Z")
"""The file that a page says to write, just before its block."""


def walk(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Do what a page says from top to bottom, in the present folder: write the files, run the rest, compare what comes.

    A flight in real time is flown headless and fast. pandas, which rtsim does not need, is used where it is installed.
    """
    text = (DOCS / page).read_text(encoding="utf-8")
    out, end = "", 0
    for found in re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        kind, content, before = found[1], found[2], text[end : found.start()]
        end = found.end()
        named = NAMED.search(before)
        if kind == "text":
            shown = [line for line in content.splitlines() if line != "..."]
            assert [line for line in shown if squeezed(line) not in squeezed(out)] == [], out
        elif kind == "sh":
            capsys.readouterr()
            for line in content.splitlines():
                obey(line)
            captured = capsys.readouterr()
            out = captured.out + captured.err
        elif kind in {"toml", "python"} and named:
            Path(named[1]).write_text(content, encoding="utf-8")
        elif "import pandas" not in content or find_spec("pandas"):
            assert kind == "python", f"nobody runs this {kind}"
            exec(compile(content, page, "exec"), {})


def squeezed(text: str) -> str:
    return " ".join(text.split())


def obey(line: str) -> None:
    """Run one command of a page; a comment says its exit code where it is not 0."""
    command, _, remark = line.partition("  # exit code ")
    program, *words = shlex.split(command)
    if program == "python":
        runpy.run_path(words[0], run_name="__main__")
    elif program == "rtsim":
        live = words[0] == "fly" and "--headless" not in words
        assert run([*words, *(["--headless", "--speed", "max"] if live else [])]) == int(remark or 0), line
    else:
        assert line == "mkdir my-flights && cd my-flights"


@pytest.mark.slow
def test_the_tutorial_is_true(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "bank_keeper", raising=False)
    walk("tutorial.md", capsys)
    assert "<img alt='corridor path" in (tmp_path / "report.html").read_text(encoding="utf-8")


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
