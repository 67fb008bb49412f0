"""The nonlinear XV-15 as an object: derivative, outputs, trim and linear model at any condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.aircraft.atmosphere import standard_atmosphere
from rtsim.aircraft.condition import SHIPPED, AircraftCondition
from rtsim.aircraft.points import Condition, LateralModel, LinearModel, TrimPoint
from rtsim.aircraft.variables import ALL_INPUTS, ALL_OUTPUTS, ALL_STATES, OUTPUTS, whole
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.tables import AircraftTables
from rtsim.arrays import FloatArray
from rtsim.kernels.kept import kept
from rtsim.kernels.packed import packed
from rtsim.units import INCH, rpm


@dataclass(frozen=True, slots=True)
class Xv15:
    """The nonlinear symmetric-plane XV-15."""

    tables: AircraftTables
    """Parameters of the kernels."""
    _work: FloatArray = field(default_factory=lambda: np.zeros(kernels.WORK_COUNT + kernels.STEP_SIZE), repr=False)

    @staticmethod
    def load(changes: Mapping[str, Any] | None = None) -> Xv15:
        """The aircraft at 13000 lb, sea level, 589 rpm with its flap schedule.

        Args:
            changes: Other values of our choices or of the sourced inputs, by ``table.key`` as in the data files
                (``rotor.induced_power_factor``).

        Raises:
            InputError: There is no such entry.
        """
        if not changes:
            return Xv15(_cached_tables())
        from rtsim.aircraft.xv15.data_reader import load_tables

        return Xv15(packed(load_tables(changes)))

    @staticmethod
    def under(condition: AircraftCondition) -> Xv15:
        """The aircraft at another weight, in other air, with its centre of gravity elsewhere.

        The pylons' share in the weight, and with it the travel of the centre of gravity with the nacelles, follows the
        weight as the source says; its height and the moments of inertia stay.

        Args:
            condition: Weight, air and centre of gravity.
        """
        return Xv15.load() if condition == SHIPPED else Xv15(_conditioned_tables(condition))

    def at(self, condition: Condition) -> Xv15:
        """The same aircraft with the condition's mass, air, rotor speed and flap."""
        base = self.tables.configuration
        density, sound_speed = base.density, base.sound_speed
        if condition.pressure_altitude is not None:
            density, sound_speed = standard_atmosphere(condition.pressure_altitude)
        configuration = base._replace(
            mass=base.mass if condition.mass is None else condition.mass,
            density=density,
            sound_speed=sound_speed,
            rotor_speed=base.rotor_speed if condition.rotor_speed is None else condition.rotor_speed,
            flap=-1.0 if condition.flap is None else condition.flap,
        )
        return Xv15(self.tables._replace(configuration=configuration))

    @property
    def airplane_rotor_speed(self) -> float:
        """Rotor speed of airplane mode [rad/s]."""
        return _airplane_rotor_speed()

    def derivative(self, x: FloatArray, u: FloatArray, nacelle_angle: float) -> FloatArray:
        """State derivative.

        Args:
            x: State, order of ``variables.ALL_STATES``; the symmetric ones (``STATES``) alone will do.
            u: Inputs, order of ``variables.ALL_INPUTS``; the symmetric ones alone will do.

        Returns:
            The rates of the states given.
        """
        xdot = np.zeros(len(ALL_STATES))
        kernels.derivative(self.tables, whole(x, ALL_STATES), whole(u, ALL_INPUTS), nacelle_angle, xdot, self._work)
        return xdot[: len(x)]

    def outputs(self, x: FloatArray, u: FloatArray, nacelle_angle: float) -> FloatArray:
        """Outputs, order of ``variables.ALL_OUTPUTS``; of symmetric states alone the symmetric ones."""
        y, xdot = np.zeros(len(ALL_OUTPUTS)), np.zeros(len(ALL_STATES))
        states, inputs = whole(x, ALL_STATES), whole(u, ALL_INPUTS)
        kernels.outputs(self.tables, states, inputs, nacelle_angle, y, xdot, self._work)
        return y if len(x) == len(ALL_STATES) else y[: len(OUTPUTS)]

    def component_loads(self, x: FloatArray, u: FloatArray, nacelle_angle: float) -> dict[str, FloatArray]:
        """Loads of each component about the centre of gravity.

        Returns:
            Force along body x and z [N], pitching moment [N m], then force along y, rolling and yawing moment.
        """
        self.derivative(x, u, nacelle_angle)
        loads = self._work[kernels.WORK.component :].copy()
        return {name: loads[kernels.AXES * i :][: kernels.AXES] for i, name in enumerate(kernels.COMPONENTS)}

    def trim(self, condition: Condition, guess: TrimPoint | None = None) -> TrimPoint:
        """Find the trim; where none was found ``converged`` is False and ``unclosed`` names the residual or control.

        Args:
            guess: A neighbouring symmetric trim to start from (continuation); None: the unstalled trim is searched for.

        Returns:
            The trim: of a symmetric condition the symmetric variables, of another all of them.
        """
        from rtsim.aircraft.xv15.steady import solve_steady
        from rtsim.aircraft.xv15.trim import solve_trim

        if not condition.symmetric:
            return solve_steady(self.at(condition).tables, condition)
        return solve_trim(self.at(condition).tables, condition, guess)

    def linearize(self, condition: Condition, trim: TrimPoint, *, step_scale: float = 1.0) -> LinearModel:
        """Jacobians at a trim point by central differences.

        Args:
            trim: The trim found there.
            step_scale: Multiplies every step; a second value checks the Jacobians.
        """
        from rtsim.aircraft.xv15.linearize import linearize_at

        return linearize_at(self.at(condition).tables, condition, trim, step_scale=step_scale)

    def linearize_lateral(self, condition: Condition, trim: TrimPoint, *, step_scale: float = 1.0) -> LateralModel:
        """Lateral Jacobians at a symmetric trim.

        Args:
            trim: The trim found there.
            step_scale: Multiplies every step; a second value checks the Jacobians.
        """
        from rtsim.aircraft.xv15.lateral_linearize import linearize_lateral_at

        tables = self.at(condition).tables
        return linearize_lateral_at(tables, condition.nacelle_angle, trim.x, trim.u, step_scale=step_scale)


@cache
def _cached_tables() -> AircraftTables:
    return packed(kept("xv15", _data(), _plain_tables))


def _data() -> bytes:
    return b"".join(path.read_bytes() for path in sorted((Path(__file__).parent / "data").glob("*.toml")))


@cache
def _airplane_rotor_speed() -> float:
    """Read once: a database asks for it at every trim."""
    from rtsim.aircraft.xv15.data_reader import read_data

    return float(rpm(read_data()[0]["rotor"]["rpm_airplane"]))


@lru_cache(maxsize=8)
def _conditioned_tables(condition: AircraftCondition) -> AircraftTables:
    from rtsim.aircraft.xv15.data_reader import load_tables, read_data

    centre, share = read_data()[0]["cg"], SHIPPED.mass / condition.mass
    changes: dict[str, Any] = {"cg.heli_SL_in": centre["heli_SL_in"] - condition.cg_forward / INCH}
    changes |= {f"cg.{key}": centre[key] * share for key in ("shift_X_ft", "shift_Z_ft")}
    tables = kept("xv15_condition", _data() + repr(changes).encode(), lambda: load_tables(changes))
    density, sound_speed = standard_atmosphere(condition.density_altitude)
    mass = tables.configuration.mass if condition.mass == SHIPPED.mass else condition.mass  # 13000.02 lb in the data
    configuration = tables.configuration._replace(mass=mass, density=density, sound_speed=sound_speed)
    return packed(tables._replace(configuration=configuration))


def _plain_tables() -> AircraftTables:
    from rtsim.aircraft.xv15.data_reader import load_tables

    return load_tables()
