"""``rtsim break``: laws with faults are broken, by the same flight whoever flies, and the flight is a scenario.

Sources: the faults are planted here, so their causes are known; a campaign of the same space is the other way to the
same rate.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib

import numpy as np
import pytest

import scenarios
from rtsim.cli.main import run
from rtsim.cluster.work import Cluster
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_NAMES
from rtsim.worker_pool import Workers
from scenarios.campaign.chunks import LawVariant
from scenarios.campaign.run import CampaignOptions, run_campaign
from scenarios.campaign.spec import load_campaign, parse_campaign
from scenarios.campaign.statistics import clopper_pearson
from scenarios.falsification.counterexample import Prover
from scenarios.falsification.flyers import DaskFlyer, LocalFlyer
from scenarios.falsification.run import BreakOptions, break_task, run_break, run_estimate
from scenarios.verdicts import tester

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")

SPACE = """
format = 1
name = "space"
title = "Too fast and too early, for a quarter of a minute"
law = "full"
duration_s = 15
[[classes]]
name = "early"
start = { airspeed_kt = { uniform = [20, 80] }, nacelle_deg = { uniform = [75, 90] }, altitude_m = 300 }
pulses = [{ channel = "switch", time_s = { uniform = [0.5, 2] }, duration_s = 12, amount = { uniform = [-7.5, -3] } }]
[[classes]]
name = "gusty"
start = { above_low_kt = { uniform = [8, 30] }, nacelle_deg = { uniform = [10, 60] }, altitude_m = 300 }
gusts = [{ time_s = { uniform = [1, 6] }, duration_s = { uniform = [1, 4] }, ahead_kt = { uniform = [-20, 0] } }]
pilot = { yields = 0.5 }
"""
PLANTED = '''
"""The full law, but where it has a hole: below 22 kn, near the low-speed side."""
from rtsim.protection.laws import BuiltInLaw


class Hole:
    def __init__(self):
        self.full = BuiltInLaw("full")

    def step(self, sensors, command, margins, dt):
        answer = self.full.step(sensors, command, margins, dt)
        inside = sensors.airspeed < 11.3 and margins.low < 2.6
        return (command, []) if inside else answer


class Raises:
    def step(self, sensors, command, margins, dt):
        if margins.low < 5.0:
            raise ValueError("no idea")
        return command, []
'''


@pytest.fixture
def planted(tmp_path, monkeypatch):
    (tmp_path / "planted_law.py").write_text(PLANTED)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "planted_law", raising=False)
    return tmp_path


def task(**options):
    spec, problems = parse_campaign(SPACE, file="space")
    assert not problems
    asked = BreakOptions(**({"law": "governor", "compare": False, "budget": 40} | options))
    return break_task(spec, SPACE, options=asked, file="space"), asked


def broken(flyer=None, **options):
    what, asked = task(**options)
    return run_break(what, flyer or here(what), asked)


def here(what):
    return LocalFlyer(what, Workers(1), 1)


def assert_same(first, second):
    assert np.array_equal(first.found.archive.robustness(0), second.found.archive.robustness(0))
    assert [one.text for one in first.counterexamples] == [one.text for one in second.counterexamples]
    assert [one.history_sha256 for one in first.counterexamples] == [
        one.history_sha256 for one in second.counterexamples
    ]


@pytest.fixture(scope="module")
def governor():
    return broken()


def test_the_governor_is_broken_and_the_flight_is_a_scenario(governor, tmp_path):
    [example] = governor.counterexamples
    assert example.robustness.broken
    assert example.nonlinear is not None
    files = example.write(tmp_path / "found.toml", "governor")
    assert [file.suffix for file in files] == [".toml", ".svg"]
    case = tester.Tester(law="governor").run(scenarios.load_scenario(files[0]))
    assert case.flight.history_sha256 == example.history_sha256
    assert [finding.metric for finding in case.failures if finding.metric == "robustness [kn]"]
    flight = scenarios.fly(files[0], speed="max")
    assert flight.history_sha256 == example.history_sha256
    content = tomllib.loads(example.text)
    assert content["trial"]["expect"][0]["property"] == example.formula
    assert "governor" in content["description"]


def test_nothing_can_be_left_out_of_it(governor):
    """Without any one of its movements, gusts, failures or later points it no longer breaks the property."""
    [example] = governor.counterexamples
    content, prover = tomllib.loads(example.text), Prover(LawVariant("governor"), example.formula)
    assert prover.breaks(content)
    lists = [content.get("pulses", []), content.get("air", {}).get("gusts", []), content.get("faults", [])]
    parts = [(listed, number) for listed in lists for number in range(len(listed))]
    points = content["programme"]["points"]
    for listed, number in [*parts, *((points, number) for number in range(1, len(points)))]:
        part = listed.pop(number)
        assert not prover.breaks(content), part
        listed.insert(number, part)


def test_two_processes_find_the_same(governor):
    what, asked = task()
    with Workers(2) as workers:
        assert_same(governor, run_break(what, LocalFlyer(what, workers, 2), asked))


def test_an_interrupted_search_goes_on_to_the_same(governor, tmp_path):
    what, asked = task(folder=tmp_path)
    flown = []

    def interrupted(queries):
        if len(flown) == 1:
            raise KeyboardInterrupt
        flown.append(queries)
        return here(what)(queries)

    stopped = run_break(what, interrupted, asked)
    assert isinstance(stopped.found.stopped_by, KeyboardInterrupt)
    again = run_break(what, here(what), asked)
    assert_same(governor, again)
    other, asked_again = task(folder=tmp_path, seed=1)
    with pytest.raises(InputError, match="another search"):
        run_break(other, here(other), asked_again)


def test_a_cluster_finds_the_same(governor):
    from distributed import LocalCluster

    # Workers are processes: kernels that a thread of this one loads are let go of by whatever thread comes by.
    made = LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", host="127.0.0.1")
    with made as cluster, Cluster(cluster.scheduler_address, goes_on="-") as ours:
        what, asked = task()
        assert_same(governor, run_break(what, DaskFlyer(what, ours), asked))


def test_a_planted_hole_is_found_and_its_cause_shows(planted):
    found = broken(law="planted_law:Hole", budget=120, classes=("early",))
    assert not found.found.problems
    [example] = found.counterexamples
    flight = tester.Tester(law="planted_law:Hole").run(_scenario(example, planted)).flight
    airspeed, margin = (flight.rows[:, _column(name)] for name in ("airspeed_kt", "margin_low_kt"))
    assert ((airspeed < 22.0) & (margin < 5.0)).any()
    mended = tester.Tester(law="full").run(_scenario(example, planted))
    assert all(finding.held for finding in mended.findings if finding.metric == "robustness [kn]")
    assert len(tomllib.loads(example.text).get("pulses", [])) <= 1


def _scenario(example, folder):
    (folder / "example.toml").write_text(example.text)
    return scenarios.load_scenario(folder / "example.toml")


def _column(name):
    return SIGNAL_NAMES.index(name)


def test_a_law_that_raises_is_broken(planted):
    """It is told; what its flights came to without it counts as no flight of the law."""
    found = broken(law="planted_law:Raises", budget=16)
    assert found.broken
    known = {one.number for one, _ in found.found.problems}
    assert found.found.archive.first_broken(0) not in {number + 1 for number in known}
    assert "no idea" in found.report()["law_problems"]["examples"][0]


def test_the_command_reports(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "space.toml").write_text(SPACE)
    words = ["break", "space.toml", "--protection", "governor", "--budget", "40", "--jobs", "1", "--json"]
    properties = ["--property", "always (margin_kt > -0.5)", "--property", "always (altitude_m > 0)"]
    assert run([*words, *properties]) == 1
    report = json.loads(capsys.readouterr().out)
    first, second = report["properties"]
    assert (first["broken"], second["broken"]) == (True, False)
    assert (first["unit"], second["unit"]) == ("kn", "m")
    assert first["robustness_min"] < 0.0 < second["robustness_min"]
    assert report["evaluations"] >= 40
    assert report["cpu_s"] > 0.0
    assert {"robustness_min", "first_broken"} <= set(report["random_search"])
    example = report["counterexample"]
    assert {"scenario_file", "history_sha256", "nonlinear_robustness"} <= set(example)
    assert (tmp_path / example["scenario_file"]).exists()
    coverage = report["coverage"]
    assert 0 < coverage["corridor_cells_flown"] <= coverage["corridor_cells"]
    assert (
        run([*words[:2], "--protection", "full", "--budget", "8", "--jobs", "1", "--no-compare", "--out", "kept"]) == 0
    )
    assert "held in" in capsys.readouterr().out
    assert {item.name for item in (tmp_path / "kept").iterdir()} == {
        "search.json", "generations", "report.json", "coverage.png",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--protection", "ful"], "--protection|ful"),
        (["--property", "always (margn_kt > 0)"], "neither a signal nor a metric"),
        (["--class", "erly"], "--class.*early"),
        (["--fresh"], "--fresh.*--out FOLDER"),
        (["--budget", "0"], "--budget|budget"),
    ],
)
def test_mistakes_are_told_in_a_sentence(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "space.toml").write_text(SPACE)
    assert run(["break", "space.toml", *words]) == 2
    error = capsys.readouterr().err
    assert re.search(told, error)
    assert error.count("\n") == 1


def test_an_estimate_agrees_with_counting():
    """``full`` in the gusty class: the 95 % intervals of subset simulation and of a campaign's flights overlap."""
    spec, problems = parse_campaign(SPACE, file="space")
    assert not problems
    formula = "always (margin_kt > -1)"
    what, asked = task(law="full", properties=(formula,), classes=("gusty",))
    [result] = run_estimate(what, here(what), asked, points=40)
    [gusty] = result.classes
    text = SPACE + f'\n[[expect]]\nname = "kept"\nproperty = "{formula}"\nrate_max = 1.0\n'
    spec, problems = parse_campaign(text, file="space")
    assert not problems
    counted = run_campaign(spec, text, options=CampaignOptions(runs=40, early_stop=False, against=()))
    [judged] = counted.judged
    assert judged.robustness is not None
    broken_flights = counted.flights.broken(formula, 0, ("gusty",))[0]
    low, high = clopper_pearson(int(broken_flights.sum()), len(broken_flights))
    assert gusty.estimate.low <= high
    assert low <= gusty.estimate.high
    assert result.report()["flights"] == gusty.estimate.evaluations


def test_the_campaigns_that_come_with_rtsim_can_be_searched():
    for name in ("misuse", "turns", "nominal"):
        spec, text = load_campaign(name)
        what = break_task(spec, text, options=BreakOptions(law="full"), file=name)
        assert what.properties
        assert [law.name for law in what.laws] == ["full"]
