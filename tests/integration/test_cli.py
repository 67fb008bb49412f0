"""The ``rtsim`` command as a process: exit codes, one-sentence errors, streams, signals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import typer

import rtsim
from rtsim.cli import main as cli
from rtsim.errors import InputError, OutputError, OverrunStop

HEAVY = {"numpy", "numba", "scipy", "control", "rerun", "matplotlib", "pyarrow", "netCDF4", "pydantic", "pandas"}


def run_process(*arguments, **options):
    command = [sys.executable, "-m", "rtsim", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, **options)


def run_inline(monkeypatch, action):
    """Run a command whose body is ``action`` through the real entry."""
    app = typer.Typer(pretty_exceptions_enable=False)
    app.callback()(lambda: None)
    app.command("act")(action)
    monkeypatch.setattr(cli, "build_app", lambda: app)
    return cli.run(["act"])


def test_help_starts_without_heavy_imports():
    program = textwrap.dedent("""
        import sys
        from rtsim.cli.main import run
        code = run(["--help"])
        print(code, sorted(name for name in sys.modules if "." not in name), file=sys.stderr)
    """)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    code, names = done.stderr.split(" ", 1)
    assert code == "0"
    assert "corridor" in done.stdout
    assert HEAVY.isdisjoint(eval(names)), HEAVY.intersection(eval(names))


def test_every_command_explains_itself(capsys):
    for name in typer.main.get_command(cli.build_app()).commands:
        assert cli.run([name, "--help"]) == 0
        assert "Usage" in capsys.readouterr().out


def test_version_names_the_database():
    done = run_process("--version")
    assert done.returncode == 0
    assert done.stdout.startswith(f"rtsim {rtsim.__version__} (database ")


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["corridor", "--nonsense"],
        ["corridor", "--airspeed-kt", "fast"],
        ["corridor", "--airspeed-kt", "1"],
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(arguments, capsys):
    assert cli.run(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("rtsim: error: ")
    assert err.count("\n") == 1
    assert err.rstrip().endswith(".")


def test_no_arguments_shows_help_and_exit_2(capsys):
    assert cli.run([]) == 2
    out, err = capsys.readouterr()
    assert "Usage" in out
    assert err == ""


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (InputError("is wrong", file="a.toml", key="rate", value=3, allowed="1 to 2", mend="lower it"), 2, "lower it."),
        (OverrunStop("too late 5 times."), 3, "too late 5 times."),
        (OutputError("a.parquet: disk full."), 4, "disk full."),
        (PermissionError(13, "Permission denied", "/root/x"), 4, "/root/x: Permission denied"),
        (ConnectionRefusedError(111, "Connection refused"), 4, "Connection refused"),
    ],
)
def test_errors_become_a_sentence_and_their_exit_code(monkeypatch, capsys, error, code, sentence):
    def act():
        raise error

    assert run_inline(monkeypatch, act) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("rtsim: error: ")
    assert sentence in err
    assert "Traceback" not in err


@pytest.mark.parametrize(("ending", "code"), [(KeyboardInterrupt(), 130), (typer.Exit(1), 1), (typer.Exit(143), 143)])
def test_endings_keep_their_exit_code(monkeypatch, capsys, ending, code):
    def act():
        raise ending

    assert run_inline(monkeypatch, act) == code
    assert "Traceback" not in capsys.readouterr().err


def test_a_fault_of_ours_is_told_apart_from_bad_input(monkeypatch, capsys):
    def act():
        raise ZeroDivisionError("division by zero")

    assert run_inline(monkeypatch, act) == 70
    err = capsys.readouterr().err
    assert "ZeroDivisionError" in err
    assert "fault of rtsim itself" in err


SLEEPER = textwrap.dedent("""
    import sys, time, typer
    from rtsim.cli import main as cli

    def act():
        try:
            print("ready", flush=True)
            time.sleep(30)
        finally:
            print("closed", flush=True)

    app = typer.Typer(pretty_exceptions_enable=False)
    app.callback()(lambda: None)
    app.command("act")(act)
    cli.build_app = lambda: app
    sys.argv = ["rtsim", "act"]
    cli.main()
""")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_unwind_and_set_the_exit_code(number, code):
    # Started with SIGINT ignored, as shells start background jobs.
    command = ["sh", "-c", 'trap "" INT; exec "$0" -c "$1"', sys.executable, SLEEPER]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (code, "closed\n", "")


def test_a_reader_that_goes_away_is_no_error():
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "rtsim", "corridor", "--json"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(writer)
    assert done.returncode == 141
    assert done.stderr == ""


def test_full_output_device_is_exit_4():
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "rtsim", "corridor", "--json"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 4
    assert done.stderr == "rtsim: error: output: No space left on device\n"


def test_json_is_the_last_line_of_stdout():
    done = run_process("corridor", "--airspeed-kt", "100", "--nacelle-deg", "75", "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout.splitlines()[-1])["inside"] is True


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_standard_streams_are_no_fault(closed):
    shell = f'"{sys.executable}" -m rtsim corridor --json {closed}'
    done = subprocess.run(["/bin/sh", "-c", shell], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    assert done.stderr == ""
