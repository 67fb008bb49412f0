"""Pacing: flies any source of frames on the wall clock's schedule and measures how well that went."""

from rtsim.realtime.clock import wait_until
from rtsim.realtime.control import FlightControl
from rtsim.realtime.executive import Executive, FrameSink, FrameSource
from rtsim.realtime.policy import OverrunPolicy
from rtsim.realtime.report import Spread, TimingReport

__all__ = [
    "Executive",
    "FlightControl",
    "FrameSink",
    "FrameSource",
    "OverrunPolicy",
    "Spread",
    "TimingReport",
    "wait_until",
]
