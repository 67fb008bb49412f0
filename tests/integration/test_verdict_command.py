"""``rtsim test`` as CI runs it: exit codes, JSON, JUnit XML, report, replay bundles, and laws that break."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

TRIAL = """
format = 1
name = "mine"
title = "A forward switch at 60 kn"
duration_s = 15
[start]
airspeed_kt = 60
nacelle_deg = 82
altitude_m = 300
[programme]
points = [{ airspeed_kt = 60, nacelle_deg = 82, hold_s = 15 }]
[[pulses]]
channel = "switch"
time_s = 2
duration_s = 6
amount = -7.5
[trial]
kind = "misuse"
off_leaves = ["corridor"]
[[trial.expect]]
name = "the corridor is kept"
metric = "exceedances"
max = 0
"""
LAWS = """
import time

class Good:
    def step(self, sensors, command, margins, dt):
        return command, []

class Raises(Good):
    def step(self, sensors, command, margins, dt):
        raise ValueError("no such thing")

class NotANumber(Good):
    def step(self, sensors, command, margins, dt):
        return type(command)(float("nan"), command.lever, command.nacelle_rate), []

class Stubborn(Good):
    def step(self, sensors, command, margins, dt):
        while sensors.time > 1.0:
            try:
                time.sleep(0.5)
            except BaseException:
                pass
        return command, []

class Odd(Good):
    def step(self, sensors, command, margins, dt):
        raise GeneratorExit("no Exception")

class Changes(Good):
    def step(self, sensors, command, margins, dt):
        object.__setattr__(command, "stick", 0.3)
        return command, []

CALLS = []

class Global(Good):
    def step(self, sensors, command, margins, dt):
        CALLS.append(1)
        return type(command)(command.stick + 1e-6 * len(CALLS), command.lever, command.nacelle_rate), []
"""


def run(folder, *arguments):
    command = [sys.executable, "-m", "rtsim", "test", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, cwd=folder)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mine.toml").write_text(TRIAL, encoding="utf-8")
    (tmp_path / "mylaws.py").write_text(LAWS, encoding="utf-8")
    return tmp_path


def test_a_first_hour_scenario_law_and_junit(folder):
    passed = run(folder, "mine.toml", "--junit", "j.xml", "--html", "r.html", "--json")
    assert passed.returncode == 0, passed.stderr
    answer = json.loads(passed.stdout.splitlines()[-1])
    assert (answer["passed"], answer["failed"]) == (1, 0)
    assert answer["cases"][0]["off_metrics"]["exceedances"] > 0
    suite = ET.parse(folder / "j.xml").getroot().find("testsuite")
    assert suite.attrib["tests"] == "1"
    properties = {item.get("name"): item.get("value") for item in suite.iter("property")}
    assert float(properties["off.depth_kt"]) > 5.0
    assert properties["law"] == "full"
    page = (folder / "r.html").read_text(encoding="utf-8")
    assert "data:image/svg+xml;base64," in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_the_first_hour_of_the_documentation_passes(tmp_path):
    page = (Path(__file__).resolve().parents[2] / "docs" / "testing-protection.md").read_text(encoding="utf-8")
    blocks = dict(reversed(re.findall(r"^   ```(python|toml)\n(.*?)^   ```", page, flags=re.DOTALL | re.MULTILINE)))
    (tmp_path / "mylaws.py").write_text(textwrap.dedent(blocks["python"]), encoding="utf-8")
    (tmp_path / "mine.toml").write_text(textwrap.dedent(blocks["toml"]), encoding="utf-8")
    command = re.search(r"rtsim test (mine\.toml [^`#\n]*)", page).group(1).split()
    ended = run(tmp_path, *command)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ET.parse(tmp_path / "results.xml").getroot().attrib["failures"] == "0"
    assert (tmp_path / "report.html").stat().st_size > 10_000


def test_a_failure_is_told_and_can_be_replayed(folder):
    failed = run(folder, "mine.toml", "--protection", "off", "--junit", "j.xml", "--out", "bundles", "--json")
    assert failed.returncode == 1
    failure = ET.parse(folder / "j.xml").getroot().find(".//failure")
    assert "exceedances=1 want <= 0" in failure.get("message")
    bundle = folder / "bundles" / "mine"
    verdict = json.loads((bundle / "verdict.json").read_text(encoding="utf-8"))
    assert verdict["logs"]["law"]["same_as_judged"]
    assert (bundle / "scenario.toml").read_text(encoding="utf-8") == TRIAL
    replay = subprocess.run(
        [sys.executable, "-m", "rtsim", "replay", "law.parquet"],
        cwd=bundle, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert replay.returncode == 0, replay.stdout + replay.stderr
    assert verdict["history_sha256"] in replay.stdout


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("Raises", "no such thing"),
        ("NotANumber", "not finite"),
        ("Global", "keeps state outside"),
        ("Stubborn", "used more than 1 s of CPU time"),
        ("Odd", "raised GeneratorExit: no Exception"),
        ("Changes", "changed what it was given"),
    ],
)
def test_a_law_that_breaks_is_named(folder, law, words):
    ended = run(folder, "mine.toml", "--protection", f"mylaws:{law}", "--junit", "j.xml", "--json")
    assert ended.returncode == 1, ended.stderr
    suite = ET.parse(folder / "j.xml").getroot()
    assert (suite.get("errors"), suite.get("failures")) == ("1", "0")
    assert words in suite.find(".//error").get("message")
    case = json.loads(ended.stdout.splitlines()[-1])["cases"][0]
    said = next(text for text in case["failures"] if text.startswith("law="))
    assert words in said, said
    assert law in said


def test_a_law_of_ones_own_that_runs_is_not_blamed(folder):
    ended = run(folder, "mine.toml", "--protection", "mylaws:Good", "--json")
    failures = json.loads(ended.stdout.splitlines()[-1])["cases"][0]["failures"]
    assert failures == ["exceedances=1 want <= 0"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("off_leaves", "of_leaves", "of_leaves"),
        ('metric = "exceedances"', 'metric = "exceedance"', "exceedances"),
        ("max = 0", "", "has no limit"),
        ('off_leaves = ["corridor"]', "", "off_leaves"),
        ("amount = -7.5", "amount = -75", "amount"),
    ],
)
def test_mistakes_name_the_key(folder, old, new, words):
    (folder / "mine.toml").write_text(TRIAL.replace(old, new), encoding="utf-8")
    ended = run(folder, "mine.toml")
    assert ended.returncode == 2
    assert words in ended.stderr
    assert "Traceback" not in ended.stderr


def test_other_mistakes_have_their_exit_codes(folder):
    assert run(folder, "mine.toml", "--protection", "fulll").returncode == 2
    assert run(folder, "manual_flight").returncode in {0, 2}
    assert run(folder, "mine.toml", "--junit", "nowhere/j.xml").returncode == 4


def test_trials_are_judged_by_the_flight_corridor_whatever_the_law_and_flights_as_they_are_flown(folder):
    ended = run(folder, "typical_conversion", "mine.toml", "--protection", "off", "--json")
    cases = json.loads(ended.stdout.splitlines()[-1])["cases"]
    assert [case["corridor_name"] for case in cases] == ["design", "flight"]
    flown = {item["metric"] for item in cases[0]["expectations"]}
    assert {"completed", "corridor.exceedances"} <= flown


def test_the_bundle_of_a_flight_without_a_trial_replays(folder):
    text = TRIAL[: TRIAL.index("[[pulses]]")]
    text += '[[expect]]\nname = "cannot hold"\nmetric = "pitch_deg.max"\nmax = -80\n'
    (folder / "flight.toml").write_text(text, encoding="utf-8")
    ended = run(folder, "flight.toml", "--out", "bundles", "--json")
    case = json.loads(ended.stdout.splitlines()[-1])["cases"][0]
    assert ended.returncode == 1
    assert case["failures"][0].endswith("want <= -80")
    assert case["failures"][0].startswith("pitch_deg.max=")
    verdict = json.loads((Path(folder / case["bundle"]) / "verdict.json").read_text(encoding="utf-8"))
    assert verdict["logs"]["law"]["same_as_judged"]


def test_the_table_fits_80_columns_and_keeps_words_whole(folder):
    ended = run(folder, "hover", "ep14_gust_beyond_authority", "ep20_nominal_reconversion_turbulence")
    table = ended.stdout.splitlines()
    assert max(map(len, table)) <= 80
    row = next(line for line in table if line.startswith("ep20"))
    assert row.split()[:3] == ["ep20_nominal_reconversion_turbulence", "nominal", "full"]


def test_a_module_that_ends_the_process_is_bad_input(folder):
    (folder / "ending.py").write_text("raise SystemExit(3)\n", encoding="utf-8")
    ended = run(folder, "mine.toml", "--protection", "ending:Law")
    assert ended.returncode == 2
    assert "cannot be imported" in ended.stderr


def test_the_report_shows_why_the_law_acted(folder):
    run(folder, "mine.toml", "--html", "r.html")
    page = (folder / "r.html").read_text(encoding="utf-8")
    picture = base64.b64decode(re.search(r"base64,([^']+)'", page).group(1)).decode()
    for words in ("corridor margin [kn]", "share of limit", "law acts"):
        assert words in picture, words
    assert "corridor flight" in page
