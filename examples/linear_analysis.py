"""Linear analysis with python-control: poles and Bode diagrams in the plane of symmetry and out of it.

python examples/linear_analysis.py [OUT.png]                 # from anywhere; by default linear_analysis.png here
rtsim linearize --airspeed-kt 100 --nacelle-deg 60 --axis both --nonlinear # the same matrices, as text
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import control
import numpy as np
from matplotlib.figure import Figure

import rtsim
from rtsim.aircraft.points import Condition
from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_STATES
from rtsim.units import deg, kt

AIRSPEED, NACELLE = kt(100), deg(60)
FREQUENCIES = np.logspace(-2, 1.5, 300)
"""[rad/s]"""


def longitudinal() -> control.StateSpace:
    """Motion in the plane of symmetry, from the shipped database."""
    model = rtsim.load_aircraft().linearize(airspeed=AIRSPEED, nacelle=NACELLE)
    return showing_states(model.A, model.B, model.state_labels, model.input_labels)


def lateral() -> control.StateSpace:
    """Motion out of it, from the nonlinear aircraft at its trim."""
    aircraft, condition = rtsim.Xv15.load(), Condition(airspeed=AIRSPEED, nacelle_angle=NACELLE)
    model = aircraft.linearize_lateral(condition, aircraft.trim(condition))
    states, inputs = ([variable.name for variable in group] for group in (LATERAL_STATES, LATERAL_INPUTS))
    return showing_states(model.A, model.B, states, inputs)


def showing_states(A: np.ndarray, B: np.ndarray, states: Sequence[str], inputs: Sequence[str]) -> control.StateSpace:
    """The model with its states as outputs; its own are loads."""
    C, D = np.eye(len(states)), np.zeros((len(states), len(inputs)))
    return control.StateSpace(A, B, C, D, states=states, inputs=inputs, outputs=states)


def main() -> None:
    """Print the slow poles and draw the answer of attitude to stick."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "linear_analysis.png")
    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for column, (title, plant, given, seen) in enumerate(
        (
            ("longitudinal", longitudinal(), "stick", "pitch"),
            ("lateral", lateral(), "lateral_stick", "bank"),
        )
    ):
        print(f"{title}: {plant.nstates} states; poles slower than 3 rad/s:")
        for pole in sorted(plant.poles(), key=abs):
            if abs(pole) < 3.0 and pole.imag >= 0.0:
                print(f"  {pole.real:+.3f} {pole.imag:+.3f}j rad/s")
        answer = control.frequency_response(plant[seen, given], FREQUENCIES)
        axes[0, column].semilogx(FREQUENCIES, 20.0 * np.log10(answer.magnitude.squeeze()))
        axes[1, column].semilogx(FREQUENCIES, np.degrees(np.unwrap(answer.phase.squeeze())))
        axes[0, column].set(title=f"{seen} by {given}, {title}", ylabel="gain [dB]")
        axes[1, column].set(xlabel="frequency [rad/s]", ylabel="phase [deg]")
    figure.savefig(out, dpi=100)
    print(f"Bode diagrams drawn in {out}")


if __name__ == "__main__":
    main()
