"""Makes the moving picture of the README: the view of a conversion with a turn, flown and then shown step by step.

Needs a Vulkan driver (Debian: mesa-vulkan-drivers) and Pillow. Usage: python docs/figures/make_moving_picture.py
"""

from __future__ import annotations

import io
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from make_view_figures import HERE, free_port, viewer_command
from PIL import Image
from rerun.experimental import ViewerClient

from rtsim.loop.simulation import Simulation
from scenarios.files.loader import load_scenario
from scenarios.flight.flight_setup import corridor_outline, flight_setup
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.view import viewer as rerun_viewer
from telemetry.view.options import ViewOptions
from telemetry.view.streamer import Streamer

SCENARIO = "conversion_turn"
STEP_S = 1.25
"""Flight time between two pictures [s]."""
SHOWN_S = 0.14
"""How long each is shown [s]."""
SIZE = (800, 500)
COLOURS = 128
MOSAIC = 6
"""Pictures that the palette is made from."""
SETTLES_S = 1.0
"""Time that the viewer is given to draw what it got [s]."""


def pictures() -> list[Image.Image]:
    """Fly the scenario, show it to a viewer without a window, and take a picture every so often."""
    scenario = load_scenario(SCENARIO)
    rows = Simulation(flight_setup(scenario)).run(round(250 * scenario.duration))
    rows = np.hstack([rows, np.zeros((len(rows), TIMING_COUNT))])
    os.environ.update(rerun_viewer.quiet_environment())
    streamer = Streamer(
        ViewOptions(viewer=True), outline=corridor_outline("design"), title="rtsim", rate_hz=250.0, port=free_port()
    )
    port = free_port()
    found = []
    with subprocess.Popen((*viewer_command(port), str(streamer.url)), stderr=subprocess.DEVNULL) as viewer:
        time.sleep(4.0)
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        step = round(250 * STEP_S)
        for first in range(0, len(rows), step):
            for at in range(first, min(first + step, len(rows)), 10):
                streamer.take(rows[at : at + 10])
                time.sleep(0.002)
            time.sleep(SETTLES_S)
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "view.png"
                client.save_screenshot(str(file))
                found.append(
                    Image.open(io.BytesIO(file.read_bytes())).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
                )
        viewer.terminate()
    streamer.close()
    return found


def main() -> None:
    """Write ``docs/figures/flight.gif``."""
    frames = pictures()
    mosaic = Image.new("RGB", (SIZE[0], SIZE[1] * MOSAIC))
    for place in range(MOSAIC):
        mosaic.paste(frames[(2 * place + 1) * len(frames) // (2 * MOSAIC)], (0, SIZE[1] * place))
    palette = mosaic.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    still = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [round(1000 * SHOWN_S)] * (len(still) - 1) + [1500]
    still[0].save(
        HERE / "flight.gif", save_all=True, append_images=still[1:], duration=durations, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
