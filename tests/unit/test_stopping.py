"""Signals end a command, also where what they raise is thrown away."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rtsim.processes import safe_environment

LOST = """
import ctypes, os, signal, sys, time
from rtsim.cli import stopping
from rtsim.kernels import progress

def callback():
    os.kill(os.getpid(), signal.SIG{name})
    for _ in range(1000):  # the handler runs in here, and ctypes throws away what it raises
        time.sleep(0.0001)

stopping.catch_signals()
try:
    ctypes.CFUNCTYPE(None)(callback)()
    print("lost", flush=True)
    {then}
except BaseException as stop:
    print(type(stop).__name__, stopping.exit_code(stopping.stopped_by()))
"""


@pytest.mark.parametrize(
    ("name", "raised"),
    [("INT", "Interrupted 130"), ("TERM", "Terminated 143"), ("HUP", "Terminated 129"), ("QUIT", "Terminated 131")],
)
@pytest.mark.parametrize("then", ["time.sleep(60)", "stopping.raise_if_lost()", "while True: pass"])
def test_what_a_callback_throws_away_is_raised_again(name: str, raised: str, then: str) -> None:
    result = subprocess.run(
        [sys.executable, "-c", LOST.format(name=name, then=then)],
        env=safe_environment(),
        capture_output=True,
        text=True,
        timeout=50,
        check=True,
    )
    assert result.stdout.splitlines() == ["lost", raised]
    assert "ignored" not in result.stderr


CLOSES = """
import os, signal, time
from rtsim.cli import stopping
stopping.catch_signals()
try:
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    finally:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(os.getpid(), number)
        print("closed", flush=True)
        stopping._closing[:] = [(stopping._closing[0][0], 0.0)]  # two seconds later
        os.kill(os.getpid(), signal.SIGINT)
        print("not reached")
except BaseException as stop:
    print(type(stop).__name__, stopping.stopped_by())
"""


def test_more_signals_do_not_cut_off_what_is_closed_and_one_that_comes_later_does() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CLOSES], env=safe_environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout == "closed\nTerminated 15\n"


START_MODULE = """
sys.argv[:], sys.orig_argv[:] = ["-m"], ["python", "-P", "-m", "rtsim"]  # as Python has it by then
import rtsim
runpy.run_module("rtsim", run_name="__main__", alter_sys=True)
"""
EARLY = """
import importlib.abc, os, runpy, sys

class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "{module}":
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, Finder())
{start}
"""


@pytest.mark.parametrize(
    ("number", "module"), [(2, "rtsim.lazy"), (1, "typer"), (2, "typer"), (3, "typer"), (15, "typer")]
)
@pytest.mark.parametrize(
    "start",
    [
        "sys.argv[:] = ['/usr/bin/rtsim', '--version']\nfrom rtsim.cli.main import main\nmain()",
        START_MODULE,
    ],
)
def test_a_signal_while_the_command_is_imported_ends_it_without_a_word(number: int, module: str, start: str) -> None:
    code = EARLY.format(number=number, module=module, start=start)
    done = subprocess.run(
        [sys.executable, "-c", code], env=safe_environment(), capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", "")


def test_an_import_of_the_command_by_others_changes_no_signal() -> None:
    code = (
        "import signal, rtsim.cli\nprint(signal.getsignal(2) is signal.default_int_handler, signal.getsignal(15) == 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], env=safe_environment(), capture_output=True, check=True)
    assert done.stdout == b"True True\n"


def test_what_was_kept_is_not_raised_again() -> None:
    script = (
        "import os, signal\nfrom rtsim.cli import stopping\nstopping.catch_signals()\n"
        "try:\n    os.kill(os.getpid(), signal.SIGTERM)\nexcept BaseException as stop:\n    kept = stop\n"
        "stopping.raise_if_lost()\nprint('goes on')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], env=safe_environment(), capture_output=True, check=True)
    assert done.stdout == b"goes on\n"
