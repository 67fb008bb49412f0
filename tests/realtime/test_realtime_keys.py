"""Keys of a pseudo-terminal act on the flight, and the terminal is put back."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import termios
import textwrap
import time

import pytest

from rtsim.realtime.control import FlightControl
from rtsim.realtime.keys import KeyReader, press


@pytest.mark.parametrize(
    ("key", "action"),
    [
        (" ", "toggle-pause"), (".", "step"), ("+", "faster"), ("-", "slower"), ("0", "reset"), ("p", "pilot"),
        ("q", "stop"),
    ],
)  # fmt: skip
def test_keys(key: str, action: str) -> None:
    control = FlightControl()
    press(control, key)
    assert [request.action for request in control.requests] == [action]


def test_other_keys_mean_nothing() -> None:
    control = FlightControl()
    for key in "xyz\x1b\n":
        press(control, key)
    assert not control.requests


def test_without_a_terminal_nothing_happens() -> None:
    reading, writing = os.pipe()
    with KeyReader(FlightControl(), descriptor=reading) as keys:
        assert not keys.active
    with KeyReader(FlightControl(), descriptor=-1) as keys:
        assert not keys.active
    os.close(reading)
    os.close(writing)


# The child makes the pseudo-terminal its own, as a shell does for a job in the foreground.
CHILD = textwrap.dedent(
    """
    import sys, termios, time
    from rtsim.realtime.control import FlightControl
    from rtsim.realtime.keys import KeyReader
    before = termios.tcgetattr(0)
    control = FlightControl()
    try:
        with KeyReader(control) as keys:
            assert keys.active
            assert not termios.tcgetattr(0)[3] & termios.ICANON
            print("ready", flush=True)
            end = time.monotonic() + 10
            while len(control.requests) < 3 and time.monotonic() < end:
                time.sleep(0.01)
            if "fail" in sys.argv:
                raise RuntimeError("on the way out")
    except RuntimeError:
        pass
    assert termios.tcgetattr(0) == before
    print("keys", *[request.action for request in control.requests], flush=True)
    """
)


@pytest.mark.parametrize("argument", ["end", "fail", "stopped"])
def test_keys_of_a_terminal_and_its_restoration(argument: str) -> None:
    main, child = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", "import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n" + CHILD, argument],
        stdin=child,
        stdout=child,
        stderr=child,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    os.close(child)
    text = _read_until(main, "ready")
    if argument == "stopped":  # what a shell leaves after Ctrl-Z and fg
        canonical = termios.tcgetattr(main)
        canonical[3] |= termios.ICANON | termios.ECHO
        termios.tcsetattr(main, termios.TCSANOW, canonical)
    os.write(main, b" .q")
    text += _read_until(main, "keys")
    process.wait(timeout=20)
    os.close(main)
    assert process.returncode == 0, text
    assert "keys toggle-pause step stop" in text


def _read_until(descriptor: int, word: str) -> str:
    text, end = "", time.monotonic() + 20
    while time.monotonic() < end:
        try:
            text += os.read(descriptor, 4096).decode(errors="replace")
        except OSError:
            break
        if word in text and text.endswith("\n"):
            break
    return text
