"""Where output goes: whole or not there, through links, to devices, refused before work (faults.md E)."""

from __future__ import annotations

import os
import shutil
import stat
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from rtsim.cli.main import run
from rtsim.errors import EXIT_OUTPUT_FAILED, OutputError
from rtsim.outside import status_of
from rtsim.whole_file import check_writable, whole_file, write_whole
from telemetry.view.options import ViewOptions
from telemetry.view.recording import claim, discard_empty, partial_name
from telemetry.view.view import RerunView


def test_what_is_no_regular_file_is_written_to(tmp_path):
    """E1: a device or a pipe named as output was replaced by a regular file."""
    pipe = tmp_path / "pipe.xml"
    os.mkfifo(pipe)
    heard = []
    reader = threading.Thread(target=lambda: heard.append(pipe.read_bytes()))
    reader.start()
    check_writable(pipe)
    write_whole(pipe, "one\n")
    reader.join(timeout=10.0)
    assert heard == [b"one\n"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    write_whole("/dev/null", b"x")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    with pytest.raises(OutputError, match="/dev/full"):
        write_whole("/dev/full", b"x")


@pytest.mark.parametrize(
    "command",
    [["corridor", "--plot"], ["test", "hover", "--junit"], ["test", "hover", "--html"]],
    ids=["plot", "junit", "html"],
)
def test_commands_write_to_a_device(command, tmp_path):
    device = tmp_path / "device.png"
    device.symlink_to("/dev/null")
    assert run([*command, str(device)]) == 0
    assert device.is_symlink()
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_a_link_stays_and_what_it_names_is_replaced(tmp_path):
    """E2."""
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    dangling = tmp_path / "dangling.txt"
    dangling.symlink_to(tmp_path / "there.txt")
    write_whole(dangling, "new")
    assert (tmp_path / "there.txt").read_text() == "new"
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(OutputError):
        write_whole(loop, "new")


def test_temporary_names_cannot_be_guessed_and_follow_no_link(tmp_path):
    """E2: a link under the predictable temporary name was followed."""
    names = set()
    for _ in range(3):
        with whole_file(tmp_path / "a.txt") as temporary:
            names.add(temporary.name)
            assert temporary.suffix == ".txt"
            temporary.write_text("x")
    assert len(names) == 3


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("x")])
def test_nothing_is_left_behind(tmp_path, error):
    """E5."""
    target = tmp_path / "a.txt"
    target.write_text("old")
    with suppress(OutputError, KeyboardInterrupt, ValueError), whole_file(target) as temporary:
        temporary.write_text("half")
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert target.read_text() == "old"


@pytest.mark.parametrize(
    "command",
    [
        ["test", "--junit", "nowhere/j.xml"],
        ["test", "--html", "."],
        ["test", "--out", "file/bundles"],
        ["campaign", "misuse", "--junit", "nowhere/j.xml"],
        ["campaign", "misuse", "--out", "file"],
        ["corridor", "--plot", "nowhere/c.png"],
        ["model", "build", "--out", "nowhere/x.nc"],
        ["model", "export", "nowhere/x.nc"],
        ["model", "import", "x.nc", "--out", "nowhere/x.nc"],
        ["optimize", "--out", "nowhere/x.toml"],
        ["reproduce", "--out", "file"],
        ["timing", "--plot", "nowhere/x.png"],
        ["log", "export", "x.parquet", "nowhere/x.csv"],
        ["plot", "x.parquet", "--out", "file"],
    ],
    ids=" ".join,
)
def test_what_cannot_be_written_is_refused_before_work(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    assert run(command) == EXIT_OUTPUT_FAILED
    told = capsys.readouterr()
    assert told.err.startswith("rtsim: error: ")
    assert told.err.count("\n") == 1
    assert os.listdir(tmp_path) == ["file"]  # noqa: PTH208 - hidden ones too


def test_a_recording_goes_through_a_link_and_not_into_a_log(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    fly = ["fly", "hover", "--headless", "--speed", "max", "--duration", "1"]
    Path("link.rrd").symlink_to("there.rrd")
    assert run([*fly, "--record", "link.rrd"]) == 0
    assert Path("link.rrd").is_symlink()
    assert Path("there.rrd").stat().st_size > 1000
    assert run([*fly, "--record", "a.parquet/x.rrd", "--log", "a.parquet"]) == 2
    assert "lies in the log" in capsys.readouterr().err
    assert not Path("a.parquet").exists()


def test_a_picture_of_no_kind_is_refused_before_work(capsys):
    for command in ("corridor", "timing"):
        assert run([command, "--plot", "/dev/full"]) == 2
        assert "unknown picture format" in capsys.readouterr().err


def test_a_bundle_replaces_a_bundle_and_nothing_else(tmp_path, monkeypatch):
    """E3's kind: a folder that was taken for ours lost what was not."""
    monkeypatch.chdir(tmp_path)
    text = 'format = 1\nname = "mine"\ntitle = "t"\nduration_s = 1\n[start]\ncondition = "hover"\n'
    asked = '[[expect]]\nname = "no"\nmetric = "airspeed_kt.final"\nmax = -9\n'
    Path("mine.toml").write_text(text + asked)
    assert run(["test", "mine.toml", "--out", "b"]) == 1
    assert run(["test", "mine.toml", "--out", "b"]) == 1
    Path("b/mine/notes.txt").write_text("dear")
    assert run(["test", "mine.toml", "--out", "b"]) == EXIT_OUTPUT_FAILED
    assert Path("b/mine/notes.txt").read_text() == "dear"
    shutil.rmtree("b/mine")
    Path("b/mine").mkdir()
    Path("b/mine/thesis.docx").write_text("dear")
    assert run(["test", "mine.toml", "--out", "b"]) == EXIT_OUTPUT_FAILED
    assert os.listdir("b") == ["mine"]  # noqa: PTH208


def test_a_place_is_looked_at_once(tmp_path, monkeypatch):
    """What vanishes between two looks ended a flight: the view renames its recording while the flight looks."""
    record = tmp_path / "x.rrd"
    partial_name(record).write_bytes(b"")
    claim(record).close()
    discard_empty(record)
    with monkeypatch.context() as earlier:
        earlier.setattr(Path, "exists", lambda *_: True)
        discard_empty(record)
    assert status_of(partial_name(record)) is None
    view = RerunView(ViewOptions(viewer=False, record=record))
    partial_name(record).unlink()
    assert view._signs_of_progress()[2:] == (-1, -1)
    process = view._process
    monkeypatch.setattr(RerunView, "_finish_process", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        view.close()
    assert process.poll() is not None  # no worker outlives a close that fails
