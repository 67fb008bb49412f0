"""Scenario files: the library loads, and every kind of mistake gets one sentence with key, value, range and mend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtsim.cli.check import file_problems
from rtsim.errors import InputError
from rtsim.programme import TURN, Programme
from rtsim.units import kt, to_deg, to_kt
from scenarios.files.expectation import Expectation
from scenarios.files.loader import library_names, load_scenario, parse_scenario, scenario_problems
from scenarios.files.options import Overrides, with_overrides
from scenarios.flight.preflight import preflight_problems

GOOD = """
format = 1
name = "mine"
title = "A flight of mine"
[flight]
plant = "lpv"
rate_hz = 250
[start]
condition = "hover"
altitude_m = 100
[programme]
acceleration_kt_s = 2.0
points = [
    { airspeed_kt = 0, nacelle_deg = 90 },
    { airspeed_kt = 40, nacelle_deg = 80, altitude_m = 120, nacelle_rate_deg_s = 2.5 },
]
[[events]]
time_s = 5.0
action = "pilot"
pilot = "hold"
[[expect]]
name = "airspeed"
metric = "airspeed_kt.rms_error"
max = 1.0
"""


def test_a_good_file_arrives_in_si() -> None:
    scenario, problems = parse_scenario(GOOD, file="mine.toml")
    assert not problems
    assert scenario is not None
    assert scenario.duration == pytest.approx(20.0)
    assert scenario.programme.at(20.0).airspeed == pytest.approx(kt(40.0))
    assert to_deg(scenario.programme.at(10.0).nacelle_angle) == pytest.approx(85.0)
    assert scenario.programme.at(10.0).altitude == pytest.approx(110.0)
    assert (scenario.start.airspeed, to_deg(scenario.start.nacelle_angle), scenario.start.altitude) == (
        0.0,
        90.0,
        100.0,
    )
    assert [(event.time, event.pilot) for event in scenario.events] == [(5.0, "hold")]
    assert scenario.expectations == (Expectation("airspeed", "airspeed_kt.rms_error", None, 1.0),)
    assert scenario.options.corridor_name == "design"
    assert scenario.source == GOOD


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("format = 1", "", ["format: is missing", "allowed: 1", "add it"]),
        ("format = 1", "format = 2", ["format", "got 2", "allowed: 1"]),
        ('name = "mine"', 'name = "My flight"', ["name: is misspelled", "'My flight'"]),
        ('title = "A flight of mine"', "title = 3", ["title: must be a text in quotes", "got 3"]),
        ('plant = "lpv"', 'plant = "lpvv"', ["flight.plant", "'lpvv'", "lpv, lpv-plain, nonlinear", "'lpv' is meant"]),
        ("rate_hz = 250", "rate_hz = 250.5", ["flight.rate_hz: must be a whole number", "50 to 1000"]),
        ("rate_hz = 250", "rate_hz = 10", ["flight.rate_hz: is out of range", "got 10", "50 to 1000"]),
        ("rate_hz = 250", "rate = 250", ["flight.rate: is not a known key", "'rate_hz' is meant"]),
        ("rate_hz = 250", "pilot_noise = 1", ["flight.pilot_noise: must be true or false"]),
        ("rate_hz = 250", 'pilot = "a b"', ["flight.pilot: is misspelled"]),
        ("rate_hz = 250", "wind_kt = 99", ["flight.wind_kt", "got 99", "-40 to 40"]),
        ('condition = "hover"', 'condition = "hovr"', ["start.condition", "hover, conversion, cruise", "'hover' is"]),
        ('condition = "hover"', 'condition = "hover"\nairspeed_kt = 3.0\nnacelle_deg = 90', ["start", "given twice"]),
        ('condition = "hover"', "airspeed_kt = 3.0", ["start.nacelle_deg: is missing", "both"]),
        ("altitude_m = 100", "altitude_m = nan", ["start.altitude_m: is out of range", "0 to 10000"]),
        ("nacelle_deg = 80", "nacelle_deg = 99", ["programme.points[1].nacelle_deg", "got 99", "0 to 90"]),
        ("nacelle_deg = 80", 'nacelle_deg = "80"', ["programme.points[1].nacelle_deg: must be a number", "'80'"]),
        ("nacelle_deg = 80, ", "", ["programme.points[1].nacelle_deg: is missing", "0 to 90"]),
        ("nacelle_deg = 80", "nacelle = 80", ["programme.points[1]", "nacelle_deg"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, time_s = 9", ["programme.points[0].time_s: is missing", "or none"]),
        ("nacelle_rate_deg_s = 2.5", "nacelle_rate_deg_s = 13", ["nacelle_rate_deg_s", "got 13", "0.1 to 12"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, heading_deg = 361", ["points[1].heading_deg", "got 361", "0 to 360"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, bank_deg = -61", ["points[1].bank_deg", "got -61", "-60 to 60"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, turn_rate_deg_s = 31", ["turn_rate_deg_s", "got 31", "-30 to 30"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, lateral_kt = 36", ["points[1].lateral_kt", "got 36", "-35 to 35"]),
        ("nacelle_deg = 80", "nacelle_deg = 80, track = 1", ["points[1].track: must be true or false"]),
        (
            "nacelle_deg = 80",
            "nacelle_deg = 80, bank_deg = 5, heading_deg = 30",
            ["points[1].bank_deg: cannot be asked for beside heading_deg", "got 5", "keep it or heading_deg"],
        ),
        (
            "nacelle_deg = 80",
            "nacelle_deg = 80, bank_deg = 5, turn_rate_deg_s = 3",
            ["points[1].turn_rate_deg_s: cannot be asked for beside bank_deg", "got 3", "keep it or bank_deg"],
        ),
        ("[programme]", "[programme", ["is not valid TOML", "line 11", "correct this line"]),
        ("[programme]", "[programme]\npoints = []", ["is not valid TOML", "line"]),
        ('pilot = "hold"', 'pilot = "sleep"', ["events[0].pilot", "'sleep'", "mocm, external, hold"]),
        ('action = "pilot"', "", ["events[0].action: is missing"]),
        ("airspeed_kt.rms_error", "airspeed.rms_error", ["expect[0].metric", "'airspeed_kt.rms_error' is meant"]),
        ("max = 1.0", "", ["expect[0]: has no limit", "add min, max or both"]),
        ("max = 1.0", "max = 1.0\nmin = 2.0", ["expect[0].min: is larger than max", "got 2.0", "at most 1"]),
        ("max = 1.0", "max = inf", ["expect[0].max"]),
    ],
)
def test_every_kind_of_mistake_names_key_value_range_and_mend(old: str, new: str, words: list[str]) -> None:
    assert old in GOOD
    scenario, problems = parse_scenario(GOOD.replace(old, new, 1), file="mine.toml")
    assert scenario is None
    text = str(problems[0])
    assert text.startswith("mine.toml: ")
    assert text.endswith(".")
    assert "\n" not in text
    for word in words:
        assert word in " | ".join(str(problem) for problem in problems)


def test_all_mistakes_are_listed_not_only_the_first() -> None:
    text = GOOD.replace("rate_hz = 250", "rate_hz = 1").replace("nacelle_deg = 80", "nacelle_deg = 99")
    _, problems = parse_scenario(text, file="mine.toml")
    assert {problem.key for problem in problems} == {"flight.rate_hz", "programme.points[1].nacelle_deg"}


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ("{ airspeed_kt = 0, nacelle_deg = 90 }, { airspeed_kt = 0, nacelle_deg = 90 }", "without a hold"),
        (
            "{ airspeed_kt = 0, nacelle_deg = 90, time_s = 0 }, { airspeed_kt = 0, nacelle_deg = 0, time_s = 5 }",
            "at most 12 deg/s",
        ),
        (
            "{ airspeed_kt = 0, nacelle_deg = 90, time_s = 0 }, { airspeed_kt = 1, nacelle_deg = 90, time_s = 0 }",
            "not later",
        ),
        (
            (
                "{ airspeed_kt = 0, nacelle_deg = 90, time_s = 0 }, "
                "{ airspeed_kt = 1, nacelle_deg = 90, time_s = 5, hold_s = 2 }"
            ),
            "no meaning beside time_s",
        ),
        ("{ airspeed_kt = 0, nacelle_deg = 90 }", "duration_s: is missing"),
        ("", "programme.points: is empty"),
    ],
)
def test_programmes_that_cannot_be_flown(points: str, words: str) -> None:
    text = f'format = 1\nname = "x"\ntitle = "x"\n[programme]\npoints = [{points}]\n'
    _, problems = parse_scenario(text, file="x.toml")
    assert words in str(problems[0])
    assert str(problems[0]).startswith("x.toml: ")


def _points(*points: str, timed: bool = True) -> Programme:
    rows = [
        f"{{ airspeed_kt = 40, nacelle_deg = 90{f', time_s = {10 * k}' if timed else ', hold_s = 5'}{more} }}"
        for k, more in enumerate(points)
    ]
    text = f'format = 1\nname = "x"\ntitle = "x"\nduration_s = 99\n[programme]\npoints = [{", ".join(rows)}]\n'
    scenario, problems = parse_scenario(text, file="x.toml")
    assert scenario is not None, problems
    return scenario.programme


@pytest.mark.parametrize("timed", [True, False])
def test_a_point_takes_from_the_one_before_what_it_does_not_say(timed: bool) -> None:
    asked = _points(
        "", ", bank_deg = 20, lateral_kt = -5, track = true", "", ", turn_rate_deg_s = -3, track = false",
        ", heading_deg = 90, lateral_kt = 0", "", timed=timed,
    )  # fmt: skip
    ends = [list(asked.time).index(10.0 * k if timed else 5.0 * (k + 1)) for k in range(6)]
    assert asked.turn_kind[ends].tolist() == [TURN.bank] * 3 + [TURN.rate] + [TURN.heading] * 2
    assert np.rad2deg(asked.turn[ends]) == pytest.approx([0.0, 20.0, 20.0, -3.0, 90.0, 90.0])
    assert asked.lateral[ends] / kt(1.0) == pytest.approx([0.0, -5.0, -5.0, -5.0, 0.0, 0.0])
    assert asked.track[ends].tolist() == [0.0, 1.0, 1.0, 0.0, 0.0, 0.0]


def test_headings_go_the_nearest_way_round() -> None:
    asked = _points(*(f", heading_deg = {angle}" for angle in (350, 10, 120, 240, 360, 300)))
    assert np.rad2deg(asked.turn) == pytest.approx([350.0, 370.0, 480.0, 600.0, 720.0, 660.0])


def test_a_straight_programme_stays_symmetric() -> None:
    assert _points("", "").symmetric
    assert not _points("", ", track = true").symmetric


def test_a_hold_needs_a_start_and_a_duration() -> None:
    _, problems = parse_scenario('format = 1\nname = "x"\ntitle = "x"\n', file="x.toml")
    assert {problem.key for problem in problems} == {"start", "duration_s"}


@pytest.mark.parametrize("name", library_names())
def test_the_library_loads_under_its_file_name(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.expectations or (scenario.trial is not None and scenario.trial.clauses)
    assert scenario.duration >= scenario.programme.duration


def test_the_library_holds_the_flights_of_the_documentation() -> None:
    assert set(library_names()) >= {
        "typical_conversion", "typical_conversion_rate3", "conversion_8deg", "reconversion", "hover", "cruise",
    }  # fmt: skip
    conversion = load_scenario("typical_conversion")
    assert conversion.duration == pytest.approx(65.9167, abs=1e-3)
    back = load_scenario("reconversion").programme
    assert (to_kt(back.airspeed[0]), to_kt(back.airspeed[-1])) == pytest.approx((170.0, 0.0))
    assert to_deg(back.nacelle_angle[-1]) == pytest.approx(90.0)
    for time in (5.0, 20.5, 40.0, 70.0):
        assert to_kt(back.rates_at(time).airspeed) == pytest.approx(-2.0)
        assert abs(to_deg(back.rates_at(time).nacelle_angle)) <= 7.5


def test_a_wrong_name_lists_the_choices_closest_first() -> None:
    with pytest.raises(InputError, match="'typical_conversion' is meant") as caught:
        load_scenario("typcal_conversion")
    assert "allowed: typical_conversion, " in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a directory"):
        load_scenario(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"format = \xff")
    assert "byte 9 is not UTF-8" in str(scenario_problems(binary)[0])
    large = tmp_path / "large.toml"
    large.write_text("#" * 4_000_001)
    with pytest.raises(InputError, match="too large"):
        load_scenario(large)
    deep = tmp_path / "deep.toml"
    deep.write_text("x = " + "[" * 100_000)
    assert scenario_problems(deep)


def test_a_file_of_ones_own_flies_by_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    assert load_scenario(str(path)).file == str(path)
    assert scenario_problems(path) == []


def test_limits_as_reported() -> None:
    both = Expectation("x", "stick.rms_in", 1.0, 2.0)
    assert both.limit == [1.0, 2.0]
    assert [both.holds(value) for value in (0.9, 1.0, 2.0, 2.1, None)] == [False, True, True, False, False]
    assert Expectation("x", "stick.rms_in", None, 2.0).limit == 2.0
    assert Expectation("x", "stick.rms_in", 1.0, None).holds(99.0)
    assert not Expectation("x", "stick.rms_in", 1.0, None).holds(float("nan"))


HOLD = 'format = 1\nname = "mine"\ntitle = "Mine"\nduration_s = 2\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            HOLD + '[flight]\npilot = "nobody"\n[start]\ncondition = "hover"\n',
            "flight.pilot: is not a pilot (got 'nobody')",
        ),
        (
            HOLD + '[flight]\nprotection = "maximum"\n[start]\ncondition = "hover"\n',
            "flight.protection: is not a protection law (got 'maximum')",
        ),
        (
            HOLD + '[start]\ncondition = "hover"\n[[events]]\ntime_s = 1\naction = "pilot"\npilot = "external"\n',
            "events[0].pilot: is not a pilot of this flight (got 'external')",
        ),
        (HOLD + "[start]\nairspeed_kt = 30\nnacelle_deg = 0\n", "start: the aircraft has no level-flight trim there"),
        (
            HOLD + '[flight]\naids = ["autoland"]\n[start]\ncondition = "hover"\n',
            "(got 'autoland'); allowed: 'rate_damping'",
        ),
    ],
)
def test_check_finds_what_would_keep_it_from_being_flown(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    [problem] = file_problems(str(path))
    assert problem.startswith(str(path))
    assert words in problem


def test_names_in_a_file_are_refused_with_the_file_and_options_with_the_option(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(HOLD + '[flight]\npilot = "nobody"\n[start]\ncondition = "hover"\n', encoding="utf-8")
    [problem] = preflight_problems(load_scenario(path))
    assert str(problem).startswith(f"{path}: flight.pilot: ")
    [problem] = preflight_problems(with_overrides(load_scenario(path), Overrides(pilot="somebody")))
    assert str(problem).startswith("--pilot: ")


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD, encoding="utf-8-sig")
    assert scenario_problems(path) == []
