"""Parameters of the vehicle: declared once, all REAL32, checked at every way in, stored on request.

Every client agrees on how a REAL32 travels; integers are packed in two incompatible ways, so there are none.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rtsim.errors import InputError
from rtsim.toml_file import read_toml
from rtsim.whole_file import write_whole


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter as ground stations see it."""

    name: str
    """At most 16 characters."""
    default: float
    """Value where nobody changed it."""
    low: float
    """Smallest value accepted."""
    high: float
    """Largest value accepted."""
    unit: str
    """Unit, empty where dimensionless."""
    description: str
    """What it does, in one sentence."""
    choices: bool = False
    """Only whole numbers are accepted."""
    stored: bool = True
    """It is kept when parameters are stored."""


RESET, NACELLE_COMMAND, PILOT, ARM_NEUTRAL = "XV_RESET", "XV_NAC_CMD", "XV_PILOT", "XV_ARM_NEUTRAL"
FLAP_COMMAND, THROTTLE_TRIM, ROTOR_SPEED = "XV_FLAP_CMD", "XV_THR_TRIM", "XV_ROTOR_RPM"
LOSS_TIME, OWNER_TIME, LEVER_RANGE, WARNINGS = "XV_MC_LOSS_T", "XV_OWNER_T", "XV_Z_BIPOLAR", "XV_WARN"

AID_PARAMETERS: dict[str, tuple[str, str]] = {
    "rate_damping": ("XV_SAS", "Pitch rate damping (SAS): 1 on, 0 off."),
    "attitude_retention": ("XV_ATT_HOLD", "Attitude retention: 1 on, 0 off."),
    "altitude_hold": ("XV_ALT_HOLD", "Altitude hold: 1 on, 0 off."),
    "airspeed_hold": ("XV_SPD_HOLD", "Airspeed hold: 1 on, 0 off."),
    "trim_bias": ("XV_TRIM_BIAS", "Bias schedule that keeps the trimmed stick near its centre: 1 on, 0 off."),
    "roll_damping": ("XV_ROLL_SAS", "Roll rate damping: 1 on, 0 off."),
    "yaw_damping": ("XV_YAW_SAS", "Damping of the yaw rate that is no turn's: 1 on, 0 off."),
    "bank_retention": ("XV_BANK_HOLD", "Bank retention: 1 on, 0 off."),
    "heading_hold": ("XV_HDG_HOLD", "Heading hold: 1 on, 0 off."),
    "turn_coordination": ("XV_TURN_COORD", "Turn coordination: 1 on, 0 off."),
    "position_hold": ("XV_POS_HOLD", "Position hold in hover: 1 on, 0 off."),
    "automatic_flaps": ("XV_AUTO_FLAP", "Flaps move by themselves with airspeed and nacelle angle: 1 on, 0 off."),
    "automatic_rotor_speed": ("XV_AUTO_RPM", "Rotors slow down by themselves on the downstop: 1 on, 0 off."),
    "governor": ("XV_GOVERNOR", "Rotor-speed governor: 1 on; 0 off: the lever is throttle and collective."),
}
"""Parameter name and description of every pilot aid there may be; a vehicle has those its flight has."""
NOT_STORED = frozenset({"automatic_flaps", "automatic_rotor_speed", "governor"})
"""Switches of the aircraft, not habits of a pilot: no flight should begin without them because of an old file."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter(RESET, 0, 0, 1, "", "1 re-trims at the start condition; reads back 0.", choices=True, stored=False),
    Parameter(PILOT, 1, 0, 2, "", "Who flies: 0 virtual pilot, 1 your sticks, 2 held.", choices=True, stored=False),
    Parameter(NACELLE_COMMAND, 90, 0, 90, "deg", "Nacelle angle to go to, 90 helicopter, 0 airplane.", stored=False),
    Parameter(FLAP_COMMAND, 40, 0, 75, "deg", "Flap setting to go to; switches automatic flaps off.", stored=False),
    Parameter(THROTTLE_TRIM, 0, -50, 50, "%", "Engine power added while the governor is off.", stored=False),
    Parameter(ROTOR_SPEED, 589, 100, 5000, "rpm", "Rotor speed to hold, lower on the downstop only.", stored=False),
    Parameter("XV_NAC_MODE", 0, 0, 1, "", "Nacelle switch: 0 moves while held, 1 runs to detents.", choices=True),
    Parameter("XV_NAC_RATE", 7.5, 0.5, 7.5, "deg/s", "Nacelle rate of switch and commands."),
    Parameter(LOSS_TIME, 0.5, 0.2, 10, "s", "Sticks count as lost after this time without input."),
    Parameter(OWNER_TIME, 2, 0.5, 60, "s", "Another ground station may take the sticks after this time without input."),
    Parameter("XV_MC_BLEND_T", 0.2, 0.02, 5, "s", "Time in which the controls pass to sticks that come (back)."),
    Parameter("XV_MC_RAMP_T", 0.3, 0.02, 5, "s", "Time in which stick and pedals return to trim when input is lost."),
    Parameter(LEVER_RANGE, 0, 0, 1, "", "MANUAL_CONTROL.z: 0 is 0..1000, 1 is -1000..1000.", choices=True),
    Parameter("XV_STK_DEAD", 0, 0, 0.3, "", "Dead band of stick and pedals, part of half travel."),
    Parameter("XV_STK_EXPO", 0, 0, 1, "", "Expo of stick and pedals: 0 straight, 1 cubic."),
    Parameter("XV_STK_SCALE", 1, 0.1, 1, "", "Stick and pedals reached at full deflection, part of half travel."),
    Parameter("XV_TRIM_RATE", 0.1, 0.01, 1, "1/s", "Rate of the stick trim buttons, half travels per second."),
    Parameter(ARM_NEUTRAL, 0.2, 0.05, 2, "", "Sticks must be this close to their centre to arm."),
    Parameter(WARNINGS, 1, 0, 1, "", "Corridor, flapping, torque, rotor and flap speed warnings.", choices=True),
)
"""Every parameter but those of the pilot aids."""


class ParameterStore:
    """The present values, in the order of their indices."""

    def __init__(self, aids: Mapping[str, bool], start: Mapping[str, float]) -> None:
        """Take the defaults and what differs from them.

        Args:
            aids: Pilot aids of the flight and whether they are on.
            start: Start values by parameter name.

        Raises:
            InputError: A start value is unknown or out of range.
        """
        declared = list(PARAMETERS)
        for aid, on in aids.items():
            name, description = AID_PARAMETERS[aid]
            stored = aid not in NOT_STORED
            declared.append(Parameter(name, float(on), 0, 1, "", description, choices=True, stored=stored))
        self.declared = tuple(sorted(declared, key=lambda parameter: parameter.name))
        """All parameters; the place is the index."""
        self.index = {parameter.name: place for place, parameter in enumerate(self.declared)}
        """Index by name."""
        self.values = [parameter.default for parameter in self.declared]
        """Present values by index."""
        for name, value in start.items():
            if self.set(name, value) is None:
                raise self._refusal(name, value)

    def __len__(self) -> int:
        return len(self.declared)

    def __getitem__(self, name: str) -> float:
        return self.values[self.index[name]]

    def at(self, place: int) -> tuple[Parameter, float]:
        """A parameter and its value by index.

        Args:
            place: From 0 to the number of parameters less 1.
        """
        return self.declared[place], self.values[place]

    def set(self, name: str, value: float) -> float | None:
        """Change a value.

        Args:
            name: The parameter.
            value: The new value.

        Returns:
            The value now in force, or None where the name is unknown or the value refused.
        """
        place = self.index.get(name)
        if place is None:
            return None
        parameter = self.declared[place]
        if not math.isfinite(value) or not parameter.low <= value <= parameter.high:
            return None
        if parameter.choices and value != round(value):
            return None
        self.values[place] = value
        return value

    def defaults(self) -> None:
        """Put every stored parameter back to its default."""
        for place, parameter in enumerate(self.declared):
            if parameter.stored:
                self.values[place] = parameter.default

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write what differs from the defaults.

        Args:
            path: A TOML file; it is whole or not there.

        Raises:
            OutputError: It cannot be written.
        """
        file = Path(path)
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = ["# Parameters of the rtsim MAVLink vehicle, stored on request of a ground station."]
        lines += [
            f"{parameter.name} = {float(value)!r}"
            for parameter, value in zip(self.declared, self.values, strict=True)
            if parameter.stored and value != parameter.default
        ]
        write_whole(file, "\n".join(lines) + "\n")

    def load(self, path: str | os.PathLike[str]) -> None:
        """Take stored values; a file that is not there changes nothing.

        Args:
            path: The TOML file.

        Raises:
            InputError: The file is wrong; nothing is taken from it then.
        """
        if not Path(path).exists():
            return
        values = read_toml(Path(path), noun="parameter", may_be_empty=True)
        before = list(self.values)
        for problem in self.problems(values, file=str(path)):
            self.values = before
            raise problem

    @classmethod
    def every_aid(cls) -> ParameterStore:
        """The parameters of a vehicle that has every pilot aid there may be."""
        return cls(dict.fromkeys(AID_PARAMETERS, False), {})

    def problems(self, values: Mapping[str, object], *, file: str) -> list[InputError]:
        """Take stored values.

        Args:
            values: Values by name.

        Returns:
            Why some were not taken.
        """
        found = []
        for name, value in values.items():
            if name in self.index and not self.declared[self.index[name]].stored:
                continue
            number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
            if self.set(name, number) is None:
                found.append(self._refusal(name, value, file=file))
        return found

    def _refusal(self, name: str, value: object, *, file: str | None = None) -> InputError:
        if name not in self.index:
            return InputError("is no parameter of this flight", file=file, key=name, mend="delete it")
        parameter = self.declared[self.index[name]]
        whole = " (whole numbers)" if parameter.choices else ""
        return InputError(
            "is out of range",
            file=file,
            key=name,
            value=value,
            allowed=f"{parameter.low:g} to {parameter.high:g}{whole}",
            mend="choose a value in this range",
        )
