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


def test_what_was_kept_is_not_raised_again() -> None:
    script = (
        "import os, signal\nfrom rtsim.cli import stopping\nstopping.catch_signals()\n"
        "try:\n    os.kill(os.getpid(), signal.SIGTERM)\nexcept BaseException as stop:\n    kept = stop\n"
        "stopping.raise_if_lost()\nprint('goes on')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], env=safe_environment(), capture_output=True, check=True)
    assert done.stdout == b"goes on\n"
