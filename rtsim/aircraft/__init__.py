"""Aircraft: their states, inputs and outputs as data, and the XV-15 made from published data."""

from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.variables import INPUT, INPUTS, OUTPUT, OUTPUTS, STATE, STATES, Variable

__all__ = [
    "INPUT",
    "INPUTS",
    "OUTPUT",
    "OUTPUTS",
    "STATE",
    "STATES",
    "Condition",
    "LinearModel",
    "TrimPoint",
    "Variable",
]
