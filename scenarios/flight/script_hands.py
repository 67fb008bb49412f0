"""The scripted pilot of a live flight: the built-in pilot's command with the script's pulses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rtsim.command import Command
from rtsim.loop.simulation import Simulation
from scenarios.files import script_kernels as kernels
from scenarios.files.script import Pulse, pulse_table


class ScriptHands:
    """Asks the built-in pilot and changes its command as a scenario's ``[[pulses]]`` say."""

    def __init__(self, pulses: Sequence[Pulse]) -> None:
        """Remember the script.

        Args:
            pulses: The movements.
        """
        self._pulses = pulse_table(pulses)
        self._state = np.zeros(kernels.SCRIPT_STATE_SIZE)
        self._command = np.zeros(3)
        self.reset()

    def reset(self) -> None:
        """The flight starts again."""
        kernels.script_start(self._state)

    def command(self, simulation: Simulation) -> Command:
        """Give the command of the coming frame.

        Args:
            simulation: What flies; the built-in pilot has the controls.
        """
        asked = simulation.pilot_command()
        self._command[:] = asked.stick, asked.lever, asked.nacelle_rate
        kernels.script_command(self._pulses, self._state, simulation.time, self._command)
        stick, lever, rate = self._command.tolist()
        return Command(stick, lever, rate)
