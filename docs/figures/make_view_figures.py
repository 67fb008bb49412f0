"""Takes the pictures of the view in docs/views.md and docs/protection.md from flights, in a viewer without a window.

Needs a Vulkan driver (Debian: mesa-vulkan-drivers). Usage: python docs/figures/make_view_figures.py [NAME...]
"""

from __future__ import annotations

import socket
import sys
import threading
from pathlib import Path

from rerun.experimental import ViewerClient

import scenarios
from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from scenarios.files.options import Overrides
from scenarios.flight.runner import FlightOutputs
from telemetry.view import viewer as rerun_viewer
from telemetry.view.options import ViewOptions

HERE = Path(__file__).parent
PICTURES = {
    "view_pilot": ("typical_conversion", "pilot", "monitor", 40.0),
    "view_engineer": ("typical_conversion", "engineer", "monitor", 40.0),
    "view_protection": ("ep06_overspeed", "pilot", "full", 22.0),
}
"""Scenario, layout, protection and time [s] of each picture."""


def take(name: str) -> None:
    """Fly in real time and take one picture."""
    scenario, layout, protection, time_s = PICTURES[name]
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    command = (
        rerun_viewer._binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port),
        "--window-size", "1600x1000", "--memory-limit", "1GiB", "--connect",
    )  # fmt: skip
    threads: list[threading.Thread] = []

    def shoot() -> None:
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.save_screenshot(str(HERE / f"{name}.png"))

    def watch(row: FloatArray) -> None:
        if not threads and row[COLUMN.time_s] >= time_s:
            threads.append(threading.Thread(target=shoot))
            threads[0].start()

    view = ViewOptions(viewer=True, viewer_command=command, layout=layout, close_viewer=True)
    overrides = Overrides(protection=protection, duration=time_s + 6.0)
    scenarios.fly(scenario, overrides=overrides, outputs=FlightOutputs(view=view, on_rows=watch))
    for thread in threads:
        thread.join()


if __name__ == "__main__":
    for wanted in sys.argv[1:] or PICTURES:
        take(wanted)
