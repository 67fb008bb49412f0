"""``rtsim check``: judges a file by what it is, and tells every mistake in one round."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtsim.cli.check import file_problems, kind_of
from rtsim.toml_file import parse_toml

ROOT = Path(__file__).parents[2]
SHIPPED = {
    "scenarios/library/hover.toml": "scenario",
    "scenarios/campaign/library/misuse.toml": "campaign",
    "examples/second_tiltrotor/search.toml": "search",
    "examples/second_tiltrotor/two_thirds.profile.toml": "profile",
    "telemetry/joystick/maps/xbox.toml": "stick map",
}
CASES = "[case.a.input]\nA = [[-1.0]]\nB = [[1.0]]\nC = [[1.0]]\nE = [[1.0]]\nq_y = [1.0]\ntau_n = [0.1]\n"


@pytest.mark.parametrize("path", SHIPPED)
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_files_are_known_by_their_keys_whatever_their_name_and_mark(tmp_path, path, mark):
    source = ROOT / path if (ROOT / path).exists() else next((ROOT / path).parent.glob("*.toml"))
    data = source.read_bytes()
    assert kind_of(parse_toml(data.decode(), file="x"), "given.toml") == SHIPPED[path]
    given = tmp_path / "given.toml"
    given.write_bytes(mark + data.replace(b'database = "two_thirds.nc"', b""))
    assert file_problems(str(given)) == []


@pytest.mark.parametrize(
    ("text", "kind"),
    [("XV_WARN = 0\n", "parameters"), (CASES, "pilot cases"), ("", "scenario"), ('borrows = ["pilot"]', "profile")],
)
def test_small_files_are_known_too(text, kind):
    assert kind_of(parse_toml(text, file="x"), "x.toml") == kind


def test_names_are_those_of_scenarios_campaigns_and_stick_maps():
    assert [file_problems(name) for name in ("hover", "misuse")] == [[], []]
    [problem] = file_problems("misue")
    assert problem.startswith("FILE: is not a scenario, campaign or stick map of the library (got 'misue')")
    assert "perhaps 'misuse' is meant" in problem


def _keys(tmp_path, text, name="mine.toml"):
    (tmp_path / name).write_text(text, encoding="utf-8-sig")
    problems = file_problems(str(tmp_path / name))
    assert all(problem.startswith(f"{tmp_path / name}: ") for problem in problems)
    return [problem.removeprefix(f"{tmp_path / name}: ").split(": ")[0] for problem in problems]


def test_a_scenario_is_told_all_its_mistakes_at_once(tmp_path):
    text = (
        'format = 1\nname = "x"\ntitle = "x"\nduratoin_s = 3\n'  # a key that is none; no duration follows from it
        '[flight]\npilot = "nobody"\nprotection = "fulll"\ndatabase = "none.nc"\n'
        '[start]\ncondition = "hover"\nairspeed_kt = 30\n'
        '[[expect]]\nname = "a"\nmetric = "no_such"\nmax = 1\n[[expect]]\nname = "b"\nmetric = "duration_s"\n'
        '[[events]]\ntime_s = 1\naction = "pilot"\npilot = "external"\n'
    )
    found = _keys(tmp_path, text)
    wanted = ["duratoin_s", "duration_s", "start", "expect[0].metric", "expect[1]", "flight.pilot", "flight.protection"]
    assert set(wanted) <= set(found)
    assert "flight.database" in found


def test_other_files_are_told_all_their_mistakes_at_once(tmp_path):
    campaign = (
        'format = 1\nname = "x"\ntitle = ""\nlaw = "fulll"\n[[classes]]\nname = "a"\nscenarios = ["hovr"]\n'
        '[[classes]]\nname = "b"\n[[expect]]\nname = "e"\nevent = "no_such"\nof = "law"\n'
    )
    assert {"title", "law", "classes[0].scenarios[0]", "classes[1].start", "expect[0].event", "expect[0]"} <= set(
        _keys(tmp_path, campaign)
    )
    search = 'objectives = ["energy", "energy"]\npoints = 99\n[search]\nmethd = "ga"\n[flight]\ndatabase = "no.nc"\n'
    wanted = {"points", "search.methd", "objectives", "search.method", "flight.database"}
    assert set(_keys(tmp_path, search)) == wanted
    stick_map = 'kind = "gamepd"\nname = ""\n[axes]\nstick = { index = 1 }\nyaw = { index = 1 }\n[buttons]\nfire = 1\n'
    assert set(_keys(tmp_path, stick_map)) >= {"kind", "axes.yaw"}
    assert _keys(tmp_path, "XV_NAC_RATE = 99.0\nXV_WRAN = 1\n") == ["XV_NAC_RATE", "XV_WRAN"]
    cases = (
        CASES
        + CASES.replace("case.a", "case.b").replace("q_y = [1.0]", "q_y = [-1.0]")
        + CASES.replace("case.a", "case.c").replace("C = [[1.0]]", "")
    )
    assert _keys(tmp_path, cases) == ["case.b.input", "case.c.input"]


def test_a_missing_database_is_no_missing_trim(tmp_path):
    start = 'format = 1\nname = "x"\ntitle = "x"\nduration_s = 3\n[flight]\ndatabase = "none.nc"\n[start]\n'
    for place in ('condition = "hover"\n', "airspeed_kt = 100\nnacelle_deg = 60\n"):
        (tmp_path / "mine.toml").write_text(start + place, encoding="utf-8")
        [problem] = file_problems(str(tmp_path / "mine.toml"))
        assert "mine.toml: flight.database: " in problem
        assert "does not exist" in problem
        assert "none.nc" in problem
    far = start.replace('database = "none.nc"\n', "") + "airspeed_kt = -39\nnacelle_deg = 90\n"
    (tmp_path / "mine.toml").write_text(far, encoding="utf-8")
    [problem] = file_problems(str(tmp_path / "mine.toml"))
    assert "mine.toml: start.airspeed: outside the database (got '-39 kn'); allowed: -20 to 260 kn" in problem
