"""Kernels as plain Python (``NUMBA_DISABLE_JIT=1``) fly, and fly the same history: for debuggers, and as a check.

Verifies finding F13 of the review: the documentation promised it, and ``Simulation`` raised. The interpreter is also an
independent execution of every kernel of the frame: equal bits say that the compiler reorders nothing.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

FLIGHTS = (
    ["typical_conversion", "--duration", "0.2"],
    ["ep04_wrong_nacelle_command", "--duration", "0.1", "--protection", "full", "--turbulence", "light"],
)


def history(arguments, **environment):
    """Hash of a flight's history by the command, in a process with this environment."""
    command = [sys.executable, "-m", "rtsim", "fly", *arguments, "--headless", "--speed", "max", "--json"]
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, check=True, timeout=600
    )
    return json.loads(done.stdout.splitlines()[-1])["history_sha256"]


@pytest.mark.parametrize("arguments", FLIGHTS, ids=" ".join)
def test_the_interpreter_flies_the_same_history(arguments):
    assert history(arguments, NUMBA_DISABLE_JIT="1") == history(arguments)
