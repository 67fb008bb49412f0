"""The nonlinear XV-15 in its plane of symmetry, from published data."""

from rtsim.aircraft.model import Xv15
from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.signals import INPUT, INPUTS, OUTPUT, OUTPUTS, STATE, STATES, Variable

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
    "Xv15",
]
