"""rtsim: a real-time, pilot-in-the-loop simulator of the Bell XV-15 tiltrotor."""

from __future__ import annotations

__version__ = "0.1.0"
