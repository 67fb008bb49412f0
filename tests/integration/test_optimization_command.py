"""``rtsim optimize`` as people and scripts meet it: JSON, the scenario file, Ctrl-C and resume, mistakes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from rtsim.cli.main import run

BUDGET = ("--generations", "4", "--population", "8", "--jobs", "2")
EXIT_BAD_INPUT, EXIT_INTERRUPTED = 2, 130


def optimize(capsys, *arguments):
    code = run(["optimize", *arguments])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return code, out, err


def answer(capsys, *arguments):
    code, out, err = optimize(capsys, *arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def without_times(summary):
    skipped = {"seconds_per_generation", "scenario_file", "record_file"}
    return {key: value for key, value in summary.items() if key not in skipped}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A search that was not interrupted."""
    out = tmp_path_factory.mktemp("whole") / "best.toml"
    finished = subprocess.run(
        process_arguments(out), check=False, capture_output=True, text=True, timeout=300, env=environment()
    )
    assert finished.returncode == 0, finished.stderr
    return json.loads(finished.stdout), out


def process_arguments(out, *more):
    return [sys.executable, "-m", "rtsim", "optimize", "--like", "typical", "--out", str(out), *BUDGET, "--json", *more]


def environment():
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


def test_the_json_says_what_was_found(whole):
    summary, out = whole
    assert set(summary) == {
        "name", "method", "handling", "seed", "database_hash", "best", "baseline", "evaluations", "generations",
        "seconds_per_generation", "interrupted", "history", "scenario_file", "record_file", "nonlinear_check",
    }  # fmt: skip
    best = summary["best"]
    assert best["feasible"]
    assert best["objective"] == "flapping_integral"
    assert best["value"] == best["figures"]["flapping_integral_deg_s"] == summary["history"][-1]
    assert all(best["value"] < path["value"] for path in summary["baseline"].values())
    assert summary["evaluations"] == 32
    assert summary["nonlinear_check"]["completed"]
    assert sorted(file.name for file in out.parent.iterdir()) == ["best.search.npz", "best.toml"]


def test_the_scenario_flies_to_the_same_figure(whole, capsys):
    summary, out = whole
    assert run(["fly", str(out), "--headless", "--speed", "max", "--json"]) == 0
    flown = json.loads(capsys.readouterr().out)
    assert flown["flapping_deg"]["integral_deg_s"] == summary["best"]["value"]
    assert flown["altitude_m"]["max_deviation"] == summary["best"]["figures"]["altitude_deviation_m"]
    assert all(clause["held"] for clause in flown["expectations"])


def test_ctrl_c_keeps_the_result_and_resume_ends_as_if_nothing_had_been(whole, tmp_path):
    out = tmp_path / "best.toml"
    process = subprocess.Popen(
        process_arguments(out), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()
    )
    record = tmp_path / "best.search.npz"
    end = time.monotonic() + 120.0
    while not record.exists():
        assert time.monotonic() < end
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    printed, err = process.communicate(timeout=120)
    assert "Traceback" not in err
    cut = json.loads(printed)
    # The file says what was done, not what was planned.
    assert f"{cut['generations']} x 8 candidates" in out.read_text(encoding="utf-8")
    # A machine that froze this test for the length of a search would end it before the signal.
    assert process.returncode == EXIT_INTERRUPTED
    assert cut["interrupted"]
    assert 1 <= cut["generations"] < 4
    assert cut["best"]["value"] == whole[0]["history"][cut["generations"] - 1]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["best.search.npz", "best.toml"]
    resumed = subprocess.run(
        process_arguments(out, "--resume"), check=False, capture_output=True, text=True, timeout=300, env=environment()
    )
    assert resumed.returncode == 0, resumed.stderr
    assert without_times(json.loads(resumed.stdout)) == without_times(whole[0])
    assert out.read_text(encoding="utf-8") == whole[1].read_text(encoding="utf-8")


def test_a_specification_file_and_a_front(tmp_path, capsys):
    spec = tmp_path / "spec.toml"
    spec.write_text(
        'name = "two"\nobjectives = ["flapping_peak", "duration"]\npoints = 4\nnacelle_rate_deg_s = 8\n'
        "[search]\nmethod = 'nsga2'\ngenerations = 2\npopulation = 8\n",
        encoding="utf-8",
    )
    summary = answer(capsys, str(spec), "--out", str(tmp_path / "two.toml"), "--no-check")
    assert summary["name"] == "two"
    assert "nonlinear_check" not in summary
    assert len(summary["best"]["points"]) == 6
    front = [tuple(point["objectives"].values()) for point in summary["front"]]
    assert front == sorted(front)
    assert all(set(point["objectives"]) == {"flapping_peak", "duration"} for point in summary["front"])


def test_options_count_before_a_file_is_judged_as_a_whole(tmp_path, capsys):
    spec = tmp_path / "spec.toml"
    spec.write_text('objectives = ["flapping_peak", "duration"]\n[search]\ngenerations = 1\npopulation = 4\n')
    out = ("--out", str(tmp_path / "two.toml"), "--no-check")
    code, _, err = optimize(capsys, str(spec), *out)
    assert code == EXIT_BAD_INPUT
    assert "spec.toml" in "".join(err.split())
    assert set(answer(capsys, str(spec), *out, "--method", "nsga2")["best"]["objectives"]) == {
        "flapping_peak",
        "duration",
    }


def test_a_new_search_keeps_the_old_record_until_it_has_its_own(tmp_path, capsys):
    record = tmp_path / "a.search.npz"
    record.write_bytes(b"hours of work")
    small = ("--generations", "1", "--population", "4", "--out", str(tmp_path / "a.toml"), "--no-check")
    assert optimize(capsys, *small, "--dask", "nonsense")[0] == EXIT_BAD_INPUT
    assert record.read_bytes() == b"hours of work"
    answer(capsys, *small)
    assert record.read_bytes() != b"hours of work"


def test_the_table_for_people(tmp_path, capsys):
    arguments = ("--generations", "1", "--population", "4", "--out", str(tmp_path / "a.toml"))
    code, out, _ = optimize(capsys, *arguments)
    assert code == 0
    for words in ("best found", "typical", "4 candidates in 1 generations", "nonlinear model completes", "rtsim fly"):
        assert words in " ".join(out.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--like", "scenic"], "is not a path"),
        (["--method", "luck"], "search.method"),
        (["--objective", "beauty"], "objectives"),
        (["--objective", "energy", "--objective", "duration", "--method", "ga"], "several objectives"),
        (["--population", "1"], "search.population"),
        (["--out", "best.txt"], "must end in .toml"),
        (["--resume"], "no record to resume from"),
        (["none.toml"], "does not exist"),
        (["none.toml", "--like", "typical"], "cannot be combined"),
        (["--dask", "nonsense"], "is not the address of a Dask scheduler"),
    ],
)
def test_mistakes_are_told_in_a_sentence(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code, out, err = optimize(capsys, *arguments)
    assert code == EXIT_BAD_INPUT
    assert words in " ".join(err.split())
    assert out == ""
    assert list(tmp_path.iterdir()) == []


def test_a_record_of_another_search_is_not_resumed(tmp_path, capsys):
    out = str(tmp_path / "a.toml")
    small = ("--generations", "1", "--population", "4", "--out", out, "--no-check")
    answer(capsys, *small)
    code, _, err = optimize(capsys, *small, "--seed", "7", "--resume")
    assert code == EXIT_BAD_INPUT
    assert "another search" in " ".join(err.split())
