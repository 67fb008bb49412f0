"""The view as it looks in a real viewer: Rerun's own, without a window, on a software renderer.

Needs the system package mesa-vulkan-drivers, which .ci/run installs; run with ``pytest -m browser``.
"""

from __future__ import annotations

import socket
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.log.corridor_outline import CorridorOutline
from telemetry.view import viewer as rerun_viewer
from telemetry.view.colours import GREEN, HIGH_SIDE, LOW_SIDE, SKY
from telemetry.view.options import Layout, ViewOptions
from telemetry.view.view import RerunView

pytestmark = pytest.mark.browser

OUTLINE = CorridorOutline.from_lines(
    "design",
    low=([95.0, 80.0, 59.3, 0.0], [-35.0, -25.0, 58.0, 101.0]),
    high=([95.0, 45.0, 0.0], [120.0, 170.0, 170.0]),
)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def hovering_rows(seconds: float) -> np.ndarray:
    rows = np.zeros((round(250 * seconds), SIGNAL_COUNT))
    rows[:, COLUMN.frame] = np.arange(len(rows))
    rows[:, COLUMN.time_s] = rows[:, COLUMN.frame] / 250.0
    rows[:, COLUMN.nacelle_deg] = rows[:, COLUMN.nacelle_reference_deg] = 60.0
    rows[:, COLUMN.airspeed_kt] = rows[:, COLUMN.airspeed_reference_kt] = 100.0
    rows[:, COLUMN.altitude_m] = rows[:, COLUMN.altitude_reference_m] = 100.0
    rows[:, COLUMN.margin_low_kt] = rows[:, COLUMN.margin_kt] = 42.0
    rows[:, COLUMN.margin_high_kt] = 55.0
    return rows


def share_of(picture: np.ndarray, colour: tuple[int, ...]) -> float:
    """Share of the picture that has nearly this colour."""
    distance = np.abs(picture[..., :3] * 255.0 - np.array(colour[:3])).max(-1)
    return float((distance < 14.0).mean())


@pytest.mark.parametrize("layout", ["pilot", "engineer"])
def test_the_viewer_shows_the_flight_without_complaint(layout: Layout, tmp_path: Path) -> None:
    from rerun.experimental import ViewerClient

    port = free_port()
    command = (
        rerun_viewer._binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port),
        "--window-size", "1600x1000", "--memory-limit", "1GiB", "--connect",
    )  # fmt: skip
    told: list[str] = []
    view = RerunView(
        ViewOptions(viewer=True, viewer_command=command, layout=layout, close_viewer=True),
        corridor=OUTLINE,
        on_message=told.append,
    )
    try:
        assert view.wait_ready(30.0)
        rows, timing = hovering_rows(25.0), np.zeros(TIMING_COUNT)
        start = time.perf_counter()
        for row in rows:
            view.push(row, timing)
            time.sleep(max(0.0, start + row[COLUMN.time_s] - time.perf_counter()))
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        state = client.get_state()
        assert state.views, "nothing was laid out"
        assert [view.reports for view in state.views if view.reports] == []
        picture_file = tmp_path / "view.png"
        client.save_screenshot(str(picture_file))
    finally:
        view.close()
    assert told == []
    picture = imread(picture_file)
    for colour, least in ((LOW_SIDE, 2e-4), (HIGH_SIDE, 2e-4), (GREEN, 2e-5)):
        assert share_of(picture, colour) > least, f"{colour} is missing on {sys.platform}"
    if layout == "pilot":
        assert share_of(picture, SKY) > 0.012, "the attitude ball is missing"
