"""A live flight holds the numbers of docs/realtime.md; the best of three runs counts, since machines are shared."""

from __future__ import annotations

from pathlib import Path

import pytest

import scenarios
from rtsim.frame import TIMING_SIGNALS
from scenarios.files.options import Overrides
from scenarios.flight.runner import FlightOutputs
from telemetry.log.reader import read_log

RUNS = 3


@pytest.mark.realtime
def test_a_live_flight_with_a_log_holds_its_period(tmp_path: Path) -> None:
    reports = []
    for number in range(RUNS):
        log = tmp_path / f"{number}.parquet"
        flight = scenarios.fly("typical_conversion", overrides=Overrides(duration=4.0), outputs=FlightOutputs(log=log))
        assert flight.completed
        report = flight.timing
        assert report.lateness_us is not None
        assert report.work_cpu_us is not None
        assert report.drift_frames is not None
        assert report.wall_s == pytest.approx(4.0, abs=0.1)
        recorded = read_log(log)
        assert recorded["overruns"][-1] <= report.overruns <= recorded["overruns"][-1] + 1
        assert all(len(recorded[signal.name]) == 1000 for signal in TIMING_SIGNALS)
        assert (recorded["lateness_us"] >= 0.0).all()
        reports.append(report)
        # How fast the machine is at the moment is measured by benchmarks and ``rtsim timing``, not judged here.
        if report.drift_frames <= 1.0:
            return
    pytest.fail(f"no run of {RUNS} kept its schedule to one frame: {reports}")
