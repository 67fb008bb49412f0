"""Takes the pictures of the view in docs/views.md and docs/protection.md from flights, in a viewer without a window.

Needs a Vulkan driver (Debian: mesa-vulkan-drivers). Usage: python docs/figures/make_view_figures.py [NAME...]
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
from rerun.experimental import ViewerClient

import scenarios
from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.programme import TURN, Programme
from rtsim.units import deg, kt
from scenarios.files.options import Overrides
from scenarios.flight.flight_setup import corridor_outline
from scenarios.flight.runner import FlightOutputs
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.view import viewer as rerun_viewer
from telemetry.view.options import ViewOptions
from telemetry.view.streamer import Streamer

HERE = Path(__file__).parent
PICTURES = {
    "view_pilot": ("typical_conversion", "pilot", "monitor", 40.0),
    "view_engineer": ("typical_conversion", "engineer", "monitor", 40.0),
    "view_protection": ("ep06_overspeed", "pilot", "full", 22.0),
    "view_turn_protection": ("ep21_steep_turn", "pilot", "full", 14.0),
}
"""Scenario, layout, protection and time [s] of each picture of a scenario, flown in real time."""
_STRAIGHT = (TURN.bank, 0.0)
SIDEWAYS = {
    "view_turn": (
        28.0, {}, (
            (0.0, 90.0, 75.0, 100.0, _STRAIGHT, 0.0), (3.0, 90.0, 75.0, 100.0, _STRAIGHT, 0.0),
            (7.0, 90.0, 75.0, 100.0, (TURN.bank, 30.0), 0.0), (30.0, 90.0, 75.0, 100.0, (TURN.bank, 30.0), 0.0),
        ),
    ),
    "view_sideward": (
        30.0, {}, (
            (0.0, 0.0, 90.0, 20.0, _STRAIGHT, 0.0), (3.0, 0.0, 90.0, 20.0, _STRAIGHT, 0.0),
            (23.0, 0.0, 90.0, 20.0, _STRAIGHT, 25.0), (35.0, 0.0, 90.0, 20.0, _STRAIGHT, 25.0),
        ),
    ),
    "view_crosswind": (
        26.0, {"wind": kt(15.0), "wind_from": deg(90.0), "ground": True}, (
            (0.0, 0.0, 90.0, 12.0, _STRAIGHT, 0.0), (14.0, 0.0, 90.0, 12.0, _STRAIGHT, 0.0),
            (34.0, 0.0, 90.0, 0.0, _STRAIGHT, 0.0),
        ),
    ),
}  # fmt: skip
"""Time [s], options and programme of each picture of a flight out of the plane of symmetry, flown beforehand. A point:
time [s], airspeed [kn], nacelle angle [deg], altitude [m], turn and its value [deg], sideward airspeed [kn]."""


def viewer_command(port: int) -> tuple[str, ...]:
    """A viewer without a window; where the flight is to be had comes after it.

    Args:
        port: Where the viewer can be asked for pictures.
    """
    return (
        rerun_viewer._binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port),
        "--window-size", "1600x1000", "--memory-limit", "1GiB", "--connect",
    )  # fmt: skip


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def shoot(port: int, name: str) -> None:
    """Save what a viewer shows."""
    ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy").save_screenshot(str(HERE / f"{name}.png"))


def take(name: str) -> None:
    """Fly a scenario in real time and take one picture."""
    scenario, layout, protection, time_s = PICTURES[name]
    port = free_port()
    threads: list[threading.Thread] = []

    def watch(row: FloatArray) -> None:
        if not threads and row[COLUMN.time_s] >= time_s:
            threads.append(threading.Thread(target=shoot, args=(port, name)))
            threads[0].start()

    view = ViewOptions(viewer=True, viewer_command=viewer_command(port), layout=layout, close_viewer=True)
    overrides = Overrides(protection=protection, duration=time_s + 6.0)
    scenarios.fly(scenario, overrides=overrides, outputs=FlightOutputs(view=view, on_rows=watch))
    for thread in threads:
        thread.join()


def take_sideways(name: str) -> None:
    """Fly a programme, show its rows, and take one picture at their end."""
    time_s, options, points = SIDEWAYS[name]
    times, speeds, nacelles, heights, turns, lateral = zip(*points, strict=True)
    track = np.ones(len(times)) if name == "view_crosswind" else np.zeros(len(times))
    programme = Programme(
        np.array(times), kt(1.0) * np.array(speeds), np.radians(nacelles), np.array(heights),
        np.array([float(kind) for kind, _ in turns]), np.radians([value for _, value in turns]),
        kt(1.0) * np.array(lateral), track,
    )  # fmt: skip
    simulation = Simulation(FlightSetup(programme=programme).with_options(protection="monitor", **options))
    rows = simulation.run(round(250 * time_s))
    rows = np.hstack([rows, np.zeros((len(rows), TIMING_COUNT))])
    os.environ.update(rerun_viewer.quiet_environment())
    streamer = Streamer(
        ViewOptions(viewer=True), outline=corridor_outline("design"), title=name, rate_hz=250.0, port=free_port()
    )
    port = free_port()
    command = (*viewer_command(port), str(streamer.url))
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as viewer:
        time.sleep(3.0)
        for first in range(0, len(rows), 8):
            streamer.take(rows[first : first + 8])
            time.sleep(0.005)
        time.sleep(10.0)  # the viewer is behind
        shoot(port, name)
        viewer.terminate()
    streamer.close()


if __name__ == "__main__":
    for wanted in sys.argv[1:] or (*PICTURES, *SIDEWAYS):
        (take if wanted in PICTURES else take_sideways)(wanted)
