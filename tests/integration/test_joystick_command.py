"""``rtsim joystick`` as a process, its keyboard on a terminal of our own, against a vehicle process."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import sys
import threading
import time

import numpy as np

from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.processes import safe_environment
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import Feedback
from telemetry.mavlink.link import MavlinkLink


def run(*options, **settings):
    return subprocess.run(
        [sys.executable, "-m", "rtsim", "joystick", *options],
        env=safe_environment(),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **settings,
    )


def test_wrong_use_is_one_sentence_and_exit_2(tmp_path):
    for options, words in (
        (["--keyboard", "--map", "xbox"], "the keyboard has its own map"),
        (["--keyboard"], "needs a terminal"),
        (["--listen", "nowhere"], "--listen"),
        (["--map", "no_such_map"], "xbox"),
        (["--rate", "1000"], "--rate"),
        (["--listen", "127.0.0.1:14550", "--connect", "127.0.0.1:14551"], "--connect"),
        (["--wizard", str(tmp_path / "map.txt")], ".toml"),
    ):
        result = run(*options, stdin=subprocess.DEVNULL)
        assert result.returncode == 2, (options, result.stderr)
        assert words in result.stderr
        assert "Traceback" not in result.stderr


def test_the_keyboard_flies_a_vehicle():
    port = 14_000 + os.getpid() % 500
    link = MavlinkLink(MavlinkConfig(targets=(Endpoint("127.0.0.1", port),)))
    link.wait_ready()
    stop, seen = threading.Event(), []

    def fly():
        row, timing, number = np.zeros(SIGNAL_COUNT), np.zeros(TIMING_COUNT), 0
        row[COLUMN.pilot_mode], row[COLUMN.lever] = 1.0, 0.6
        lever = 0.6
        while not stop.is_set():
            row[COLUMN.frame], row[COLUMN.time_s] = number, number * 0.004
            sticks = link.input.read()
            if sticks.lever_valid:
                lever = sticks.lever
            seen.append(sticks)
            link.report(Feedback(lever=lever, input_state=1.0))
            link.push(row, timing)
            number += 1
            time.sleep(0.004)

    flight = threading.Thread(target=fly)
    flight.start()
    master, slave = pty.openpty()
    player = subprocess.Popen(
        [
            *(sys.executable, "-m", "rtsim", "joystick", "--keyboard", "--json"),
            *("--listen", f"127.0.0.1:{port}", "--duration", "20"),
        ],
        env=safe_environment(),
        stdin=slave,
        stdout=subprocess.PIPE,
        stderr=slave,
        text=True,
    )
    try:
        shown = ""
        end = time.monotonic() + 20.0
        while not seen or seen[-1].sequence == 0:
            assert time.monotonic() < end, shown
            if select.select([master], [], [], 0.05)[0]:
                shown += os.read(master, 65536).decode(errors="replace")
        first = next(sticks for sticks in seen if sticks.sequence)
        assert abs(first.lever - 0.6) < 0.002  # it begins where the vehicle's lever is
        for keys in ("r", "r", "w", "m"):
            os.write(master, keys.encode())
            time.sleep(0.1)
        begin, count = time.monotonic(), seen[-1].sequence
        while time.monotonic() - begin < 1.0:
            if select.select([master], [], [], 0.05)[0]:
                os.read(master, 65536)
        assert 40 <= seen[-1].sequence - count <= 60  # 50 a second
        os.write(master, b"x")
        output, _ = player.communicate(timeout=10)
    finally:
        stop.set()
        flight.join()
        if player.poll() is None:
            player.kill()
        os.close(master)
        os.close(slave)
        link.close()
    assert abs(seen[-1].lever - 0.62) < 0.002
    assert max(sticks.stick for sticks in seen) > 0.3
    assert min(sticks.nacelle_switch for sticks in seen) == -1
    assert player.returncode == 0
    assert json.loads(output.splitlines()[-1])["vehicle"] == 1
