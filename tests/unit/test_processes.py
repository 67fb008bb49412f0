"""Helper processes: nothing of the current folder in them, nothing left behind by them, whoever dies."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from rtsim.errors import InputError
from rtsim.loop import beside
from rtsim.processes import end_process, ending, safe_environment, start_process
from rtsim.worker_pool import WorkersDied, work

ROOT = Path(__file__).resolve().parents[2]
SHADOWS = (
    "telemetry",
    "rtsim",
    "scenarios",
    "random",
    "numpy",
    "code",
    "multiprocessing",
    "subprocess",
    "pyarrow",
    "json",
)
"""Modules that somebody may have a file of his own for."""
FLY = ["fly", "hover", "--headless", "--speed", "max", "--duration", "1", "--log", "a.parquet"]


@pytest.fixture(name="folder")
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, full of files that must not be run."""
    for name in SHADOWS:
        (tmp_path / f"{name}.py").write_text("open(__file__ + '.ran', 'w').close()\nraise SystemExit('shadow')\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ran(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.ran"))


def wait_until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert holds()


def square(number: int) -> int:
    return number * number


def refuse(number: int) -> int:
    raise InputError("is wrong", key=f"piece {number}")


def say(number: int) -> int:
    sys.stdout.write(f"piece {number}\n")
    return number


def die_once(marker: str) -> str:
    if not Path(marker).exists():
        Path(marker).write_text("died")
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def hang_once(marker: str) -> str:
    if not Path(marker).exists():
        Path(marker).write_text("hangs")
        os.kill(os.getpid(), signal.SIGSTOP)
    return "done"


def die(number: int) -> None:
    os._exit(number)


@pytest.mark.parametrize("path", ["", ":.", "nowhere:{here}"])
def test_helpers_and_workers_import_nothing_of_the_current_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    monkeypatch.setenv("PYTHONPATH", path.format(here=folder))
    helper = start_process("telemetry.log.recorder_worker", str(folder / "log"), "{}", stdin=subprocess.DEVNULL)
    end_process(helper, patience_s=60.0)
    assert ending(helper) == "exit code 0"
    assert list(work(square, [(3,), (4,)], jobs=2)) == [9, 16]
    assert ran(folder) == []


@pytest.mark.parametrize("variables", [{}, {"PYTHONPATH": f"{ROOT}{os.pathsep}"}])
@pytest.mark.parametrize("command", [["-m", "rtsim"], ["-c", "from rtsim.cli.main import main; main()"]])
def test_the_command_imports_nothing_of_the_current_folder(
    folder: Path, variables: dict[str, str], command: list[str]
) -> None:
    (folder / "rtsim.py").unlink()  # ``python -m rtsim`` where rtsim.py lies runs that, which is what was asked for
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    # Those that Python itself needs before it comes to rtsim are its own affair.
    for name in ("code", "subprocess", "json"):
        (folder / f"{name}.py").unlink()
    result = subprocess.run(
        [sys.executable, *command, *FLY],
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert ran(folder) == []


def test_a_plug_in_is_found_beside_files_that_are_called_like_modules(folder: Path) -> None:
    (folder / "mylaws.py").write_text("class Law:\n    def step(self, *given):\n        return given[1]\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    (folder / "rtsim.py").unlink()
    for law, code in (("mylaws:Law", 0), ("numpy:Law", 2)):
        result = subprocess.run(
            [sys.executable, "-P", "-m", "rtsim", *FLY, "--overwrite", "--protection", law],
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert result.returncode == code, result.stderr
    assert "give numpy.py another name" in result.stderr
    assert ran(folder) == []


def test_results_come_in_the_order_of_the_pieces_and_from_several_processes() -> None:
    assert list(work(square, [(number,) for number in range(30)], jobs=3)) == [number**2 for number in range(30)]
    assert len(set(work(os.getpid, [()] * 8, jobs=2)) - {os.getpid()}) == 2
    assert list(work(os.getpid, [()] * 2, jobs=1)) == [os.getpid()] * 2


def test_what_a_piece_raises_is_raised_here_word_for_word() -> None:
    with pytest.raises(InputError, match=r"^piece 1: is wrong\.$"):
        list(work(refuse, [(1,), (2,)], jobs=2))


def test_what_a_piece_prints_does_not_come_between_the_results(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(work(say, [(1,), (2,)], jobs=2)) == [1, 2]
    assert capfd.readouterr().out == ""


def test_the_piece_of_a_worker_that_died_is_given_to_another(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    pieces = [(str(tmp_path / f"died{number}"),) for number in range(4)]
    assert list(work(die_once, pieces, jobs=2)) == ["done"] * 4
    assert [record.getMessage() for record in caplog.records] == [
        "A worker process died (ended by SIGKILL); another does its piece."
    ] * 4


def test_the_piece_of_a_worker_that_hangs_is_given_to_another(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtsim.worker_pool.HANG_S", 1.0)
    assert list(work(hang_once, [(str(tmp_path / "0"),), (str(tmp_path / "1"),)], jobs=2)) == ["done"] * 2
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == 2
    assert re.fullmatch(r"A worker process died \(it did nothing for \d+ s and was ended\); another .*", told[0])


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("import os; os.kill(os.getpid(), 19)", "it did nothing for"),
        ("import os; os.kill(os.getpid(), 9)", "ended by SIGKILL"),
        ("raise SystemExit(1)", "exit code 1"),
        ("import time\nend = time.monotonic() + 1.5\nwhile time.monotonic() < end: pass", None),
    ],
)
def test_a_flight_waits_for_what_compiles_beside_it_only_while_that_works(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, code: str, told: str | None
) -> None:
    monkeypatch.setattr(beside, "HANG_S", 0.5)
    monkeypatch.setenv(beside.CHILD, "1")  # nothing is remembered
    process = subprocess.Popen([sys.executable, "-c", code])
    monkeypatch.setattr(beside, "_running", [process])
    beside.finish("lpv")
    assert process.returncode is not None
    messages = [record.getMessage() for record in caplog.records]
    assert len(messages) == (told is not None)
    assert told is None or told in messages[0]


def test_a_piece_that_ends_every_worker_is_given_up() -> None:
    with pytest.raises(WorkersDied, match=r"died \(exit code 7\), and so did 2 that replaced it"):
        list(work(die, [(7,), (7,)], jobs=2))


def test_no_worker_outlives_results_that_nobody_wants() -> None:
    me = psutil.Process()
    before = set(me.children(recursive=True))
    results = work(square, [(number,) for number in range(10)], jobs=2)
    assert next(results) == 0
    workers = set(me.children(recursive=True)) - before
    assert len(workers) == 2
    results.close()
    wait_until(lambda: not any(worker.is_running() for worker in workers))


PARENTS = {
    "pool": "from rtsim.worker_pool import work\nfrom time import sleep\nlist(work(sleep, [(600,), (600,)], jobs=2))",
    "view": (
        "import time\nfrom pathlib import Path\nfrom telemetry.view.view import RerunView\n"
        "from telemetry.view.options import ViewOptions\n"
        "view = RerunView(ViewOptions(viewer=False, record=Path('a.rrd')))\ntime.sleep(600)"
    ),
    "mavlink": (
        "import time\nfrom telemetry.mavlink.link import MavlinkLink\n"
        "from telemetry.mavlink.config import MavlinkConfig\nlink = MavlinkLink(MavlinkConfig())\ntime.sleep(600)"
    ),
    "compiling": (
        "import os, time\nfrom rtsim.loop import beside\nfrom rtsim.kernels import store\n"
        "store.read = lambda name: None\nos.cpu_count = lambda: 2\nbeside.start('lpv')\ntime.sleep(600)"
    ),
}


@pytest.mark.parametrize(("early", "group"), [(True, False), (False, True)])
@pytest.mark.parametrize("kind", PARENTS)
def test_nothing_is_left_of_a_killed_process_or_group(tmp_path: Path, kind: str, early: bool, group: bool) -> None:
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    flight = subprocess.Popen(
        [sys.executable, "-c", PARENTS[kind]],
        cwd=tmp_path,
        env={**safe_environment(), "TMPDIR": str(temporary), "XDG_CACHE_HOME": str(tmp_path / "cache")},
        start_new_session=True,
    )
    parent = psutil.Process(flight.pid)
    count = 2 if kind == "pool" else 1
    wait_until(lambda: len(parent.children(recursive=True)) >= count)
    helpers = parent.children(recursive=True)
    if not early:
        time.sleep(0.7)  # at work, or nearly
        for process in (parent, *helpers):
            assert "/dev/shm" not in Path(f"/proc/{process.pid}/maps").read_text(), "it could be left behind"
    os.killpg(flight.pid, signal.SIGKILL) if group else flight.kill()
    flight.wait(60.0)
    for helper in helpers:
        with contextlib.suppress(psutil.NoSuchProcess):
            helper.wait(60.0)
    assert list(temporary.iterdir()) == []
