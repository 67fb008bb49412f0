"""Makes the moving picture of the README: the view of a conversion with a turn, flown and then shown step by step.

Needs a Vulkan driver (Debian: mesa-vulkan-drivers) and Pillow. Usage: python docs/figures/make_moving_picture.py
"""

from __future__ import annotations

import time

from make_view_figures import HERE, SMALL, flown, picture, quiet_streamer, viewing
from PIL import Image

SCENARIO = "conversion_turn"
STEP_S = 1.25
"""Flight time between two pictures [s]."""
SHOWN_S = 0.14
"""How long each is shown [s]."""
SIZE = (800, 450)
COLOURS = 255
MOSAIC = 8
"""Pictures that the palette is made from."""
SETTLES_S = 0.8
"""Time that the viewer is given to draw what it got [s]."""


def pictures() -> list[Image.Image]:
    """Fly the scenario, show it to a viewer without a window, and take a picture every so often."""
    log = flown(SCENARIO, "monitor")
    streamer = quiet_streamer(log, "pilot")
    events = list(log.events)
    found = []
    with viewing(SMALL, "--connect", str(streamer.url)) as client:
        step = round(log.metadata.rate_hz * STEP_S)
        for first in range(0, len(log.rows), step):
            piece = log.rows[first : first + step]
            for at in range(0, len(piece), 25):
                streamer.take(piece[at : at + 25])
            while events and events[0].frame < first + step:
                event = events.pop(0)
                streamer.event(event.text, event.level)
            streamer.flush()
            time.sleep(SETTLES_S)
            found.append(picture(client).resize(SIZE, Image.Resampling.LANCZOS))
    streamer.close()
    return found


def main() -> None:
    """Write ``docs/figures/flight.gif``."""
    frames = pictures()
    mosaic = Image.new("RGB", (SIZE[0], SIZE[1] * MOSAIC))
    for place in range(MOSAIC):
        mosaic.paste(frames[(2 * place + 1) * len(frames) // (2 * MOSAIC)], (0, SIZE[1] * place))
    palette = mosaic.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, kmeans=2)
    still = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [round(1000 * SHOWN_S)] * (len(still) - 1) + [1500]
    still[0].save(
        HERE / "flight.gif", save_all=True, append_images=still[1:], duration=durations, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
