"""What may be chosen about the Rerun view; importable without Rerun."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Layout = Literal["pilot", "cockpit", "engineer", "compare"]
"""Layouts with which the viewer opens."""


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """How to show a flight."""

    viewer: bool = True
    """Open a viewer window."""
    record: Path | None = None
    """Recording to write (``.rrd``), or none."""
    layout: Layout = "pilot"
    """Layout of the viewer."""
    replay: bool = False
    """Play what has been flown from its start, instead of following the flight."""
    pictures_per_second: float = 30.0
    """How often pose and instruments are drawn [Hz]."""
    plot_rate_hz: float = 50.0
    """Points of a curve per second of flight [Hz]."""
    memory_limit: str = "2GiB"
    """Memory after which the viewer forgets the oldest data."""
    close_viewer: bool = False
    """Close the viewer's window at the end of the flight instead of leaving it to be looked at."""
    stall_timeout_s: float = 5.0
    """A view that shows no sign of life for this long is ended [s]."""
    restarts: int = 1
    """How often a view that stalled or crashed is started again."""
    viewer_command: tuple[str, ...] | None = None
    """Another program to start as viewer (the connect URL is appended); None is Rerun's own."""


def display_available() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in {"darwin", "win32"}:
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
