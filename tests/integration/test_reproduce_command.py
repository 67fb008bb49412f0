"""``rtsim reproduce`` as a user runs it: report, claims, figures, mistakes, interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

COMMAND = [sys.executable, "-m", "rtsim", "reproduce"]


def run(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=600, check=False)


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    out = tmp_path_factory.mktemp("reproduction") / "new"
    ended = run("--out", out, "--jobs", os.cpu_count() or 1, "--json")
    assert ended.returncode == 0, ended.stderr
    return out, json.loads(ended.stdout.splitlines()[-1])


@pytest.mark.slow
def test_figures_and_report_are_written(reproduced):
    out, answer = reproduced
    for number in range(1, 19):
        root = ET.parse(out / "figures" / f"figure_{number:02d}.svg").getroot()
        assert root.tag.endswith("svg")
        assert (out / "figures" / f"figure_{number:02d}.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<figure ") == 18
    assert 'src="http' not in page
    assert answer["report"] == str(out / "report.html")
    assert not list(out.rglob("*.part*"))


@pytest.mark.slow
def test_claims_carry_numbers_and_verdicts(reproduced):
    out, answer = reproduced
    claims = {claim["id"]: claim for claim in answer["claims"]}
    assert json.loads((out / "claims.json").read_text(encoding="utf-8"))["claims"] == answer["claims"]
    assert all(set(claim) >= {"id", "holds", "measured", "expected", "why"} for claim in answer["claims"])
    held = {
        "table1_timing", "fig1_corridor", "fig2_grid", "fig3_pilot", "fig4_path", "fig5_early_peak",
        "fig7_fast_side", "fig8_worse", "fig10_larger_oscillation", "fig12_collective_falls",
        "fig14_small_acceleration", "fig16_max_rate", "fig17_18_effort_time",
    }  # fmt: skip
    assert {name for name in held if not claims[name]["holds"]} == set()
    assert claims["fig5_early_peak"]["measured"]["early_peak_deg"] == pytest.approx(4.65, abs=0.3)
    assert claims["fig16_max_rate"]["measured"]["rate_deg_s"] == pytest.approx(12.0, abs=0.1)
    assert claims["fig14_small_acceleration"]["measured"]["acceleration_kt_s"] == pytest.approx(1.2, abs=0.1)
    # Flown by us, these three do not come out as the paper says; the report tells why.
    assert not claims["fig4_least_integral"]["holds"]
    assert not claims["text_lpv_accuracy"]["holds"]
    assert not claims["fig6_map"]["holds"]


def test_a_file_in_the_way_is_told(tmp_path):
    target = tmp_path / "taken"
    target.write_text("", encoding="utf-8")
    ended = run("--out", target)
    assert ended.returncode == 4
    assert "taken is no folder" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_directory_that_cannot_be_made_is_told(tmp_path):
    ended = run("--out", Path("/proc/nowhere"))
    assert ended.returncode == 4
    assert "/proc/nowhere: cannot be written" in ended.stderr


def test_ctrl_c_ends_it_cleanly(tmp_path):
    out = tmp_path / "out"
    process = subprocess.Popen(
        [*COMMAND, "--out", str(out), "--jobs", "2"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120.0
    while not (out / "figures").exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(2.0)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the command and its workers
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert not (out / "report.html").exists()
    assert list((out / "figures").iterdir()) == []
