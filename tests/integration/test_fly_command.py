"""``rtsim fly`` as people and scripts meet it: JSON, exit codes, signals, kills, files that cannot be written."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import json
import os
import pty
import resource
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rtsim.cli.fly import parse_speed
from rtsim.cli.main import run
from rtsim.errors import InputError
from rtsim.loop.options import FlightOptions
from scenarios.flight.replay import replay_log
from telemetry.log.reader import read_log

KEYS = {
    "scenario": None, "pilot": None, "plant": None, "protection": None, "corridor_name": None, "rate_hz": None,
    "seed": None, "options": set(FlightOptions().shown()),
    "duration_s": None, "wall_s": None, "real_time_factor": None, "frames": None, "completed": None,
    "end_reason": None, "overruns": None, "lateness_us": {"p50", "p99", "max"}, "drift_frames": None,
    "work_us": {"p50", "p99"}, "work_cpu_us": {"p50", "p99"}, "history_sha256": None,
    "corridor": {"exceedances", "worst_margin_kt", "time_outside_s"},
    "flapping_deg": {"peak", "peak_time_s", "peak_after_30_s", "rms", "integral_deg_s"},
    "airspeed_kt": {"final", "rms_error", "max_error"}, "nacelle_deg": {"final", "max_error", "max_rate_deg_s"},
    "altitude_m": {"max_deviation", "final"}, "pitch_deg": {"min", "max"},
    "stick": {"rms_in", "rms_rate_in_s", "travel_in"}, "lever": {"rms", "rms_rate_per_s", "travel"},
    "controls_on_stop_frames": None, "expectations": None,
}  # fmt: skip


def command(*arguments: str, **options: Any) -> subprocess.Popen[str]:
    """Start ``rtsim fly --headless`` as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "rtsim", "fly", "--headless", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        **options,
    )


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Wait for a process; its exit code and what it wrote."""
    out, err = process.communicate(timeout=120)
    assert "Traceback" not in err, err
    return process.returncode, out, err


def wait_for(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def test_the_json_has_the_promised_keys_on_the_last_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fly", "--headless", "--speed", "max", "--json"]) == 0
    output = capsys.readouterr()
    answer = json.loads(output.out.splitlines()[-1])
    assert len(output.out.splitlines()) == 1
    for key, inner in KEYS.items():
        assert key in answer
        if inner is not None:
            assert set(answer[key]) == inner
    assert answer["completed"] is True
    assert all(set(item) == {"name", "held", "value", "limit"} for item in answer["expectations"])
    assert all(item["held"] for item in answer["expectations"])
    assert len(answer["history_sha256"]) == 64
    assert "kn" in output.err
    assert "deg" in output.err


def test_a_failed_expectation_is_exit_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "strict.toml"
    path.write_text(
        'format = 1\nname = "strict"\ntitle = "Strict"\nduration_s = 2\n[start]\ncondition = "hover"\n'
        '[[expect]]\nname = "is at 200 m"\nmetric = "altitude_m.final"\nmin = 200\n',
        encoding="utf-8",
    )
    assert run(["fly", str(path), "--headless", "--speed", "max", "--json"]) == 1
    output = capsys.readouterr()
    expectations = json.loads(output.out)["expectations"]
    assert expectations[1] == {"name": "is at 200 m", "held": False, "value": pytest.approx(100.0), "limit": 200.0}
    assert "FAILED is at 200 m: 100 m (limit 200 m)" in output.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["hovr"], "perhaps 'hover' is meant"),
        (["none.toml"], "does not exist"),
        (["--pilot", "mavlink", "--speed", "max"], "MAVLink needs a paced flight"),
        (["--protection", "much"], "--protection"),
        (["--mavlink", "192.0.2.1:14550"], "--mavlink-network"),
        (["--speed", "fast"], "0.001 to 1000"),
        (["--speed", "0"], "0.001 to 1000"),
        (["--rate", "20"], "50 to 1000 Hz"),
        (["--duration", "-1"], "--duration"),
        (["--overrun-policy", "stop"], "stop:N"),
        (["--record", "view.txt"], "must end in .rrd"),
        (["--airspeed-kt", "20"], "--nacelle-deg: is missing"),
        (["--plant", "glider"], "--plant"),
        (["--no-such-option"], "no-such-option"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["fly", "--headless", *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    lines = [line for line in output.err.splitlines() if line.startswith("rtsim: error:")]
    assert len(lines) == 1
    assert words in lines[0]
    assert "Traceback" not in output.err


def test_no_display_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert run(["fly", "hover", "--duration", "0.1", "--speed", "max"]) == 0
    assert [line for line in capsys.readouterr().err.splitlines() if "No display" in line]


def test_speeds() -> None:
    assert parse_speed("max") == float("inf")
    assert parse_speed("2.5") == 2.5
    for text in ("inf", "nan", "", "1e9"):
        with pytest.raises(InputError, match="real time"):
            parse_speed(text)


@pytest.mark.parametrize(
    ("number", "code", "words"),
    [
        (signal.SIGINT, 130, "Ctrl-C"),
        (signal.SIGTERM, 143, "SIGTERM"),
        (signal.SIGHUP, 129, "SIGHUP"),
        (signal.SIGQUIT, 131, "SIGQUIT"),
    ],
)
def test_signals_end_the_flight_cleanly(tmp_path: Path, number: int, code: int, words: str) -> None:
    log = tmp_path / "a.parquet"
    process = command("hover", "--json", "--log", str(log))
    wait_for((log / "part-000001.parquet").exists)
    process.send_signal(number)
    returned, out, err = ended(process)
    assert returned == code
    assert f"stopped by {words}" in err
    answer = json.loads(out.splitlines()[-1])
    assert answer["completed"] is False
    flight = read_log(log)
    assert flight.summary is not None
    assert flight.summary["history_sha256"] == answer["history_sha256"] == flight.history_sha256()
    assert len(flight.rows) == answer["frames"]
    assert replay_log(log).same


def test_a_closed_terminal_ends_the_flight_with_its_log_closed_and_nohup_does_not(tmp_path: Path) -> None:
    for ignored, code in ((False, 129), (True, 0)):
        log = tmp_path / f"{ignored}.parquet"
        main, child = pty.openpty()
        process = subprocess.Popen(
            [sys.executable, "-m", "rtsim", "fly", "--headless", "hover", "--duration", "3", "--log", str(log)],
            stdin=child,
            stdout=child,
            stderr=child,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            start_new_session=True,
            preexec_fn=functools.partial(own_terminal, ignored),  # noqa: PLW1509 - it calls into nothing that locks
        )
        os.close(child)
        if ignored:
            process.send_signal(signal.SIGHUP)
        drained = threading.Thread(target=drain, args=(main, log / "part-000001.parquet", ignored))
        drained.start()
        assert process.wait(120) == code
        drained.join()
        summary = read_log(log).summary
        assert summary is not None
        assert ("SIGHUP" in summary["end_reason"]) == (not ignored)


def own_terminal(ignored: bool) -> None:
    """Take the terminal as one's own, as a shell does; ignore its end, as nohup does."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    if ignored:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)


def drain(terminal: int, file: Path, to_the_end: bool) -> None:
    """Read what a terminal shows, and close it once a file is there."""
    with contextlib.suppress(OSError):
        while to_the_end or not file.exists():
            if select.select([terminal], [], [], 0.02)[0]:
                os.read(terminal, 4096)
    os.close(terminal)


def test_the_overrun_policy_is_exit_3() -> None:
    returned, out, err = ended(command("hover", "--speed", "1000", "--overrun-policy", "stop:7", "--json"))
    assert returned == 3
    answer = json.loads(out.splitlines()[-1])
    assert answer["overruns"] == 7
    assert "stop:7" in answer["end_reason"]
    assert "rtsim: error: stopped by the overrun policy" in err


def test_a_kill_leaves_a_log_that_reads_up_to_the_last_second(tmp_path: Path) -> None:
    log = tmp_path / "a.parquet"
    process = command("hover", "--log", str(log))
    wait_for((log / "part-000003.parquet").exists)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=30)
    time.sleep(0.5)  # the writer of the log is a process of its own and finishes what it was given
    flight = read_log(log)
    assert flight.summary is None
    assert len(flight.rows) >= 750
    assert list(flight["frame"]) == list(range(len(flight.rows)))
    assert replay_log(log).same


def test_paths_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = str(tmp_path / "none" / "a.parquet")
    assert run(["fly", "hover", "--headless", "--duration", "1", "--speed", "max", "--log", missing]) == 4
    assert "cannot be written" in capsys.readouterr().err
    (tmp_path / "mine.parquet").write_text("my data", encoding="utf-8")
    assert run(["fly", "hover", "--headless", "--duration", "1", "--log", str(tmp_path / "mine.parquet")]) == 2
    assert "choose another path" in capsys.readouterr().err
    assert (tmp_path / "mine.parquet").read_text(encoding="utf-8") == "my data"


def test_a_log_is_only_replaced_when_asked_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "fly",
        "hover",
        "--headless",
        "--duration",
        "1",
        "--speed",
        "max",
        "--log",
        str(tmp_path / "a.parquet"),
    ]
    assert run(arguments) == 0
    assert run(arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert run([*arguments, "--overwrite"]) == 0
    assert replay_log(tmp_path / "a.parquet").same


def limit_files() -> None:
    """Let no file of this process and its children grow beyond 70 kB: less than a second of a conversion's log."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (70_000, 70_000))


def test_a_full_disk_is_exit_4_and_the_flight_is_flown_to_its_end(tmp_path: Path) -> None:
    log = tmp_path / "a.parquet"
    process = command(
        "typical_conversion", "--speed", "max", "--duration", "10", "--log", str(log), "--json", preexec_fn=limit_files
    )
    returned, out, err = ended(process)
    assert returned == 4
    assert json.loads(out.splitlines()[-1])["completed"] is True
    assert [line for line in err.splitlines() if line.startswith(f"rtsim: error: {log}")]
    leftovers = [entry.name for entry in log.iterdir() if not entry.name.startswith(("part-", "_events"))]
    assert leftovers == []


def test_two_flights_at_once_do_not_meet(tmp_path: Path) -> None:
    one = command("hover", "--duration", "2", "--log", str(tmp_path / "a.parquet"), "--json")
    two = command("hover", "--duration", "2", "--log", str(tmp_path / "b.parquet"), "--json")
    answers = []
    for process in (one, two):
        returned, out, _ = ended(process)
        assert returned == 0
        answers.append(json.loads(out.splitlines()[-1]))
    assert answers[0]["history_sha256"] == answers[1]["history_sha256"]
    assert replay_log(tmp_path / "a.parquet").same
    assert replay_log(tmp_path / "b.parquet").same


def test_check_lists_every_mistake_of_every_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text(
        'format = 1\nname = "x"\ntitle = "x"\nduration_s = 0\n[start]\ncondition = "hovr"\n', encoding="utf-8"
    )
    fake = tmp_path / "fake.nc"
    fake.write_text("no database", encoding="utf-8")
    names = ["hover", str(bad), str(fake), str(tmp_path / "none.nc"), str(tmp_path / "picture.png")]
    assert run(["check", *names, "--json"]) == 2
    output = capsys.readouterr()
    answer = json.loads(output.out.splitlines()[-1])
    assert [len(item["problems"]) for item in answer["files"]] == [0, 2, 1, 1, 1]
    assert not answer["valid"]
    assert len([line for line in output.err.splitlines() if line.startswith("rtsim: error:")]) == 5
    assert run(["check", "hover", "cruise"]) == 0
    assert "hover: good" in capsys.readouterr().out


def test_timing_reports_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "timing.png"
    assert run(["timing", "--duration", "0.4", "--plot", str(picture), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["frames"] == 100
    assert set(answer["lateness_us"]) == {"p50", "p99", "max"}
    assert [goal["limit"] for goal in answer["goals"]] == [10.0, 250.0, 1.0]
    assert picture.stat().st_size > 1000
    assert run(["timing", "--duration", "0.4"]) == 0
    assert "lateness" in capsys.readouterr().out
    assert run(["timing", "--duration", "0"]) == 2
    assert run(["timing", "--rate", "5"]) == 2
    assert run(["timing", "--duration", "0.1", "--plot", str(tmp_path / "timing.xyz")]) == 2
