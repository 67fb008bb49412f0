"""Pacing: flies any source of frames on the wall clock's schedule and measures how well that went."""

from rtsim.realtime.clock import wait_until
from rtsim.realtime.control import FlightControl
from rtsim.realtime.executive import Executive, FrameSink
from rtsim.realtime.policy import OverrunPolicy
from rtsim.realtime.report import Spread, TimingReport
from rtsim.realtime.source import FrameSource, SwitchedFlight

__all__ = [
    "Executive",
    "FlightControl",
    "FrameSink",
    "FrameSource",
    "OverrunPolicy",
    "Spread",
    "SwitchedFlight",
    "TimingReport",
    "wait_until",
]
