"""Campaigns: the same verdict for any number of workers, after interruption and on a cluster that loses a worker."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from rtsim.cluster.work import Cluster
from rtsim.errors import InputError
from scenarios.campaign.chunks import plan_chunks
from scenarios.campaign.draws import draw_plan
from scenarios.campaign.executors import DaskExecutor, LocalExecutor
from scenarios.campaign.run import CampaignOptions, run_campaign
from scenarios.campaign.spec import parse_campaign
from scenarios.campaign.trial import Bench

CAMPAIGN = """
format = 1
name = "small"
title = "A small campaign"
law = "full"
against = ["governor"]
duration_s = 15
runs = 20
[[classes]]
name = "early"
start = { airspeed_kt = { uniform = [30, 70] }, nacelle_deg = { uniform = [78, 88] } }
pulses = [{ channel = "switch", time_s = 1, duration_s = 12, amount = { uniform = [-7.5, -4] } }]
[[classes]]
name = "gusty"
nominal = true
start = { above_low_kt = { uniform = [35, 45] }, nacelle_deg = { uniform = [5, 60] } }
turbulence_kt = { uniform = [5, 10] }
gusts = [{ time_s = 2, duration_s = 4, ahead_kt = { uniform = [1, 4] }, either_sign = true }]
[[expect]]
name = "kept"
event = "exceeded"
rate_max = 0.05
[[expect]]
name = "off leaves"
event = "exceeded"
of = "off"
classes = ["early"]
rate_min = 0.7
"""
BREAKING = """
class Sometimes:
    def step(self, sensors, command, margins, dt):
        if sensors.nacelle_angle < 1.2:
            raise RuntimeError("cannot do that")
        return command, []

class EndsTheProcess(Sometimes):
    def step(self, sensors, command, margins, dt):
        import os
        os._exit(0)
"""
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")


def campaign(text=CAMPAIGN):
    spec, problems = parse_campaign(text, file="small.toml")
    assert problems == []
    return spec, text


def flown(executor=None, **options):
    return run_campaign(*campaign(), options=CampaignOptions(early_stop=False, **options), executor=executor)


@pytest.fixture(scope="module")
def alone():
    return flown()


def assert_same(first, second):
    assert [item.held for item in first.judged] == [item.held for item in second.judged]
    for one, other in zip(first.flights.metrics, second.flights.metrics, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_campaign_holds_and_tells_laws_apart(alone):
    assert alone.held
    report = alone.report()
    pair = next(item for item in report["comparisons"] if item["against"] == "off" and item["event"] == "exceeded")
    assert pair["only_first"] == 0
    assert pair["only_second"] >= 14
    assert pair["p_value"] < 1e-3
    off = next(item for item in report["laws"] if item["law"] == "off")
    assert off["depth_kt"]["p50"]["low"] <= off["depth_kt"]["p50"]["value"] <= off["depth_kt"]["p50"]["high"]


def test_two_processes_give_the_same(alone):
    assert_same(alone, flown(LocalExecutor(2)))


class Backwards(LocalExecutor):
    def fly(self, task, chunks):
        yield from reversed(list(super().fly(task, chunks)))


def test_pieces_may_be_finished_in_any_order(alone, tmp_path):
    options = CampaignOptions(early_stop=False, folder=tmp_path)
    assert_same(alone, run_campaign(*campaign(), options=options, executor=Backwards(1)))
    assert len(list((tmp_path / "chunks").glob("*.npz"))) == len(plan_chunks(campaign()[0], None))


def test_a_run_does_not_depend_on_what_was_flown_before_it(alone):
    spec, _ = campaign()
    bench = Bench()
    for law, place in (("full", 0), ("governor", 1), ("off", 2)):
        flight = bench.fly(draw_plan(spec, seed=0, class_number=1, run=13), law)
        np.testing.assert_array_equal(flight.metrics.numbers, alone.flights.metrics[1][13, place])


def test_another_seed_is_another_campaign(alone):
    assert not np.array_equal(flown(seed=1, runs=10).flights.metrics[0], alone.flights.metrics[0][:10])


class Breaks(LocalExecutor):
    """Ends like a user's Ctrl-C after some pieces."""

    def fly(self, task, chunks):
        for number, result in enumerate(super().fly(task, chunks)):
            if number == 2:
                raise KeyboardInterrupt
            yield result


def test_an_interrupted_campaign_goes_on_to_the_same_verdict(alone, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        flown(Breaks(1), folder=tmp_path / "kept")
    damaged = sorted((tmp_path / "kept" / "chunks").glob("*.npz"))
    assert len(damaged) == 2
    damaged[0].write_bytes(damaged[0].read_bytes()[:100])  # a piece that was cut off counts as not flown
    resumed = flown(folder=tmp_path / "kept")
    assert resumed.reused == 1
    assert_same(alone, resumed)
    with pytest.raises(InputError, match="another campaign"):
        flown(folder=tmp_path / "kept", seed=5)
    assert flown(folder=tmp_path / "kept", seed=5, fresh=True).reused == 0


def test_it_ends_as_soon_as_the_verdict_is_certain():
    text = CAMPAIGN.replace("rate_max = 0.05", "rate_max = 0.0").replace('law = "full"', 'law = "off"')
    result = run_campaign(*campaign(text.replace('against = ["governor"]', "")), options=CampaignOptions())
    assert result.stopped_early
    assert not result.held
    assert sum(len(item) for item in result.flights.metrics) < sum(result.flights.planned)


def test_sweeping_the_buffer_draws_the_operating_characteristic():
    result = flown(runs=10, buffers_kt=(-4.0, 6.0), against=())
    points = result.report()["operating_characteristic"]
    assert [point["buffer_kt"] for point in points] == [-4.0, 0.0, 6.0]
    nuisance = [point["nuisance"]["count"] for point in points]
    assert nuisance == sorted(nuisance)
    assert points[0]["exceeded"]["total"] == 10


@pytest.fixture(scope="module")
def cluster():
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", host="127.0.0.1"
    ) as made:
        yield made


def test_a_cluster_that_loses_a_worker_gives_the_same(alone, cluster):
    connected = Cluster(cluster.scheduler_address, goes_on="")
    victim = next(iter(cluster.workers.values())).pid
    done = []

    def kill():
        while not done:
            time.sleep(0.01)
        os.kill(victim, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        result = run_campaign(
            *campaign(),
            options=CampaignOptions(early_stop=False),
            executor=DaskExecutor(connected),
            on_progress=lambda count, _: done.append(count),
        )
    finally:
        done.append(0)
        killer.join()
        connected.__exit__(None, None, None)
    assert victim not in [worker.pid for worker in cluster.workers.values() if worker.status.name == "running"]
    assert_same(alone, result)


def test_runs_are_planned_in_turn():
    spec, _ = campaign()
    assert [(item.class_number, item.first, item.count) for item in plan_chunks(spec, 15)] == [
        (0, 0, 10), (1, 0, 10), (0, 10, 5), (1, 10, 5),
    ]  # fmt: skip


def run(folder, *arguments):
    command = [sys.executable, "-m", "rtsim", "campaign", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, cwd=folder)


def test_the_command_reports_and_keeps(tmp_path):
    (tmp_path / "small.toml").write_text(CAMPAIGN, encoding="utf-8")
    ended = run(tmp_path, "small.toml", "--runs", 10, "--jobs", 1, "--out", "kept", "--junit", "j.xml", "--json")
    assert ended.returncode == 0, ended.stderr
    answer = json.loads(ended.stdout.splitlines()[-1])
    assert answer["held"]
    assert ET.parse(tmp_path / "j.xml").getroot().attrib["failures"] == "0"
    assert json.loads((tmp_path / "kept" / "report.json").read_text(encoding="utf-8"))["runs"] == answer["runs"]
    lines = (tmp_path / "kept" / "flights.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + answer["flights"]
    again = run(tmp_path, "small.toml", "--runs", 10, "--jobs", 1, "--out", "kept")
    assert again.returncode == 0, again.stderr
    assert "left the corridor" in again.stdout


def test_a_law_that_breaks_is_named_and_the_campaign_goes_on(tmp_path):
    (tmp_path / "small.toml").write_text(CAMPAIGN, encoding="utf-8")
    (tmp_path / "mylaws.py").write_text(BREAKING, encoding="utf-8")
    arguments = (
        "small.toml",
        "--runs",
        2,
        "--jobs",
        1,
        "--protection",
        "mylaws:Sometimes",
        "--no-early-stop",
        "--json",
    )
    ended = run(tmp_path, *arguments)
    assert ended.returncode == 1, ended.stderr
    answer = json.loads(ended.stdout.splitlines()[-1])
    assert answer["runs"] == 4
    problems = answer["law_problems"]
    assert problems["flights"] >= 2
    assert "cannot do that" in problems["examples"][0]["text"]
    assert problems["examples"][0]["law"] == "mylaws:Sometimes"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["misuze"], 2, "misuse"),
        (["misuse", "--protection", "fulll"], 2, "full"),
        (["misuse", "--fresh"], 2, "--out"),
        (["misuse", "--jobs", "2", "--dask", "tcp://127.0.0.1:1"], 2, "--jobs"),
        (["misuse", "--junit", "nowhere/j.xml"], 4, "folder"),
    ],
)
def test_mistakes_are_told_in_a_sentence(tmp_path, arguments, code, words):
    ended = run(tmp_path, *arguments)
    assert ended.returncode == code, ended.stderr
    assert words in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_wrong_key_in_a_campaign_is_an_error():
    for old, new, words in (
        ("rate_max", "rate_maximum", "rate_maximum"),
        ('event = "exceeded"\nrate_max', 'event = "exeeded"\nrate_max', "exceeded"),
        ('classes = ["early"]', 'classes = ["late"]', "is not a class"),
        ("rate_min = 0.7", "", "has no limit"),
    ):
        spec, problems = parse_campaign(CAMPAIGN.replace(old, new), file="small.toml")
        assert spec is None
        assert words in str(problems[0])


def test_a_worker_process_that_dies_is_told_in_a_sentence(tmp_path):
    (tmp_path / "mylaws.py").write_text(BREAKING, encoding="utf-8")
    (tmp_path / "small.toml").write_text(CAMPAIGN, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-m", "rtsim", "campaign", "small.toml", "--jobs", "2", "--protection",
         "mylaws:EndsTheProcess"],
        capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert ended.returncode == 4, ended.stderr
    assert "a worker process died" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_check_reads_campaign_files(tmp_path):
    (tmp_path / "small.toml").write_text(CAMPAIGN, encoding="utf-8")
    (tmp_path / "wrong.toml").write_text(CAMPAIGN.replace("rate_max", "rate_mex"), encoding="utf-8")
    command = [sys.executable, "-m", "rtsim", "check", "small.toml", "wrong.toml"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.returncode == 2
    assert "small.toml: good" in ended.stdout
    assert "wrong.toml: expect[0].rate_mex" in ended.stderr


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("uniform = [30, 70]", "uniform = [70, 30]", "classes[0].start.airspeed_kt.uniform"),
        ("{ uniform = [30, 70] }", "{ normal = [50, -5] }", "classes[0].start.airspeed_kt.normal"),
        ("{ uniform = [30, 70] }", "{ choice = [50, 60], weights = [1] }", "classes[0].start.airspeed_kt.weights"),
        ("{ uniform = [30, 70] }", "{ choice = [50, 60], weights = [0, 0] }", "classes[0].start.airspeed_kt.weights"),
        ("uniform = [78, 88]", "uniform = [100, 190]", "classes[0].start.nacelle_deg"),
        ("uniform = [-7.5, -4]", "uniform = [-75, -4]", "classes[0].pulses[0].amount"),
        ("time_s = 2", "time_s = -2", "classes[1].gusts[0].time_s"),
    ],
)
def test_distributions_that_mean_nothing_are_named(old, new, key):
    spec, problems = parse_campaign(CAMPAIGN.replace(old, new), file="small.toml")
    assert spec is None
    assert [problem.key for problem in problems] == [key]
    assert problems[0].file == "small.toml"
