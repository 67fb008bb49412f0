"""From a person's sticks to a command: shaping, nacelle switch, conversion by command, loss of input and recovery."""

from rtsim.sticks.handler import INPUT_LIVE, INPUT_LOST, INPUT_NONE, StickHandler, StickSituation
from rtsim.sticks.settings import StickSettings
from rtsim.sticks.transition import TransitionSchedule, transition_schedule

__all__ = [
    "INPUT_LIVE",
    "INPUT_LOST",
    "INPUT_NONE",
    "StickHandler",
    "StickSettings",
    "StickSituation",
    "TransitionSchedule",
    "transition_schedule",
]
