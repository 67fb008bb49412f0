"""Takes the pictures of the view in docs/views.md and docs/protection.md from flights, in a viewer without a window.

Needs a Vulkan driver (Debian: mesa-vulkan-drivers) and Pillow. Usage:

    python docs/figures/make_view_figures.py [NAME...]      the pictures of the pages, or some of them
    python docs/figures/make_view_figures.py --all FOLDER   every layout in five situations at both sizes (10 minutes)
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

import scenarios
from rtsim.frame import COLUMN
from scenarios.files.options import Overrides
from scenarios.flight.runner import FlightOutputs
from telemetry.log.reader import FlightLog, read_log
from telemetry.view import viewer as rerun_viewer
from telemetry.view.logged import record_logs
from telemetry.view.options import Layout, ViewOptions
from telemetry.view.streamer import Streamer

HERE = Path(__file__).parent
SMALL, LARGE = "1280x720", "1920x1080"
LAYOUTS: tuple[Layout, ...] = ("pilot", "cockpit", "engineer")
SITUATIONS = {
    "hover": ("hover", "monitor", 9.0),
    "conversion": ("typical_conversion", "monitor", 40.0),
    "turn": ("standard_turn_80_75", "monitor", 25.0),
    "cruise": ("typical_conversion", "monitor", 65.5),
    "exceedance": ("ep06_overspeed", "monitor", 24.0),
    "protection": ("ep06_overspeed", "full", 22.0),
    "turn_protection": ("ep21_steep_turn", "full", 14.0),
    "sideward": ("sideward_flight", "monitor", 30.0),
    "crosswind": ("crosswind_landing", "monitor", 26.0),
}
"""Scenario, protection and time [s] of what is shown."""
PICTURES: dict[str, tuple[str, Layout, str]] = {
    "view_pilot": ("conversion", "pilot", SMALL),
    "view_engineer": ("conversion", "engineer", LARGE),
    "view_cockpit": ("turn", "cockpit", SMALL),
    **{
        f"view_{name}": (name, "pilot", SMALL)
        for name in ("hover", "turn", "cruise", "exceedance", "protection", "turn_protection", "sideward", "crosswind")
    },
}
"""Situation, layout and size of the pictures that the pages show."""
COMPARED = (("typical_conversion", "conversion_8deg"), 49.0)
"""Two scenarios that are laid over each other, and the time [s]: ``view_compare``."""
COLOURS = 256
LONGEST_SETTLING_S = 25.0


@cache
def flown(scenario: str, protection: str) -> FlightLog:
    """The log of a flight.

    Args:
        scenario: Name of the scenario.
        protection: Law that watches it.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{scenario}.parquet"
        scenarios.fly(
            scenario, speed="max", overrides=Overrides(protection=protection), outputs=FlightOutputs(log=path)
        )
        return read_log(path)


@contextlib.contextmanager
def viewing(size: str, *source: str) -> Iterator[ViewerClient]:
    """A viewer without a window, which can be asked for pictures.

    Args:
        size: Of the window that is not there.
        *source: What it shows, as words of its command line.
    """
    port = free_port()
    command = (
        rerun_viewer._binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size,
        "--memory-limit", "4GiB", *source,
    )  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as viewer:
        time.sleep(2.5)
        try:
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            viewer.terminate()


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def picture(client: ViewerClient) -> Image.Image:
    """What a viewer shows now.

    Args:
        client: The viewer.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "view.png"
        client.save_screenshot(str(file))
        with Image.open(file) as found:
            return found.convert("RGB")


def settled(client: ViewerClient) -> Image.Image:
    """What a viewer shows once it has drawn all that it was sent.

    Args:
        client: The viewer.
    """
    deadline, before = time.monotonic() + LONGEST_SETTLING_S, picture(client)
    while time.monotonic() < deadline:
        time.sleep(1.0)
        now = picture(client)
        if now.tobytes() == before.tobytes():
            break
        before = now
    return before


def quiet_streamer(log: FlightLog, layout: Layout) -> Streamer:
    """Where rows are shown that viewers can have.

    Args:
        log: The flight.
        layout: Layout of the viewer.
    """
    os.environ.update(rerun_viewer.quiet_environment())
    return Streamer(
        ViewOptions(viewer=True, layout=layout), outline=log.metadata.corridor, title=log.metadata.scenario_name,
        rate_hz=log.metadata.rate_hz, port=free_port(),
    )  # fmt: skip


def take(situation: str, layout: Layout, size: str, target: Path) -> None:
    """Show a flight up to its moment, and keep the picture.

    Args:
        situation: What is shown.
        layout: Layout of the viewer.
        size: Of the picture.
        target: Where to.
    """
    scenario, protection, time_s = SITUATIONS[situation]
    log = flown(scenario, protection)
    rows = log.rows[log["time_s"] <= time_s]
    events = [event for event in log.events if event.time_s <= time_s]
    streamer = quiet_streamer(log, layout)
    with viewing(size, "--connect", str(streamer.url)) as client:
        for first in range(0, len(rows), 25):
            streamer.take(rows[first : first + 25])
            while events and events[0].frame <= rows[min(first + 25, len(rows)) - 1, COLUMN.frame]:
                event = events.pop(0)
                streamer.event(event.text, event.level)
        streamer.flush()
        keep(settled(client), target)
    streamer.close()


def take_comparison(target: Path) -> None:
    """Lay two flights over each other, play them up to the moment, and keep the picture.

    Args:
        target: Where to.
    """
    names, time_s = COMPARED
    logs = [flown(name, "monitor") for name in names]
    os.environ.update(rerun_viewer.quiet_environment())
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "compared.rrd"
        record_logs(logs, recording, layout="compare")
        with viewing(SMALL, str(recording)) as client:
            time.sleep(8.0)  # it has read the recording
            client.set_time("sim_time", duration=time_s, play_state="paused")
            keep(settled(client), target)


def keep(shown: Image.Image, target: Path) -> None:
    """Save a picture with few colours, which makes it small.

    Args:
        shown: The picture.
        target: Where to.
    """
    palette = shown.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, kmeans=2)
    shown.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(target, optimize=True)


def take_all(folder: Path) -> None:
    """Every layout in every situation at both sizes, to be looked at.

    Args:
        folder: Where to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for situation in ("hover", "conversion", "turn", "cruise", "exceedance"):
        for layout in LAYOUTS:
            for size in (SMALL, LARGE):
                take(situation, layout, size, folder / f"{situation}-{layout}-{size}.png")


def main() -> None:
    """Do what the command line says."""
    if sys.argv[1:2] == ["--all"]:
        take_all(Path(sys.argv[2]))
        return
    for name in sys.argv[1:] or (*PICTURES, "view_compare"):
        if name == "view_compare":
            take_comparison(HERE / "view_compare.png")
        else:
            take(*PICTURES[name], HERE / f"{name}.png")


if __name__ == "__main__":
    main()
