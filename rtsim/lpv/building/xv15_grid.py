"""The XV-15 as the database builder sees it: solves, filters and linearizes one grid point."""

from __future__ import annotations

import hashlib
import platform
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from importlib.resources import files

import numpy as np

import rtsim
import rtsim.aircraft.xv15
from rtsim.aircraft.condition import SHIPPED, AircraftCondition
from rtsim.aircraft.points import Condition, LinearModel, TrimPoint
from rtsim.aircraft.variables import INPUT, INPUTS, OUTPUT, OUTPUTS, STATE, STATES, Variable
from rtsim.aircraft.xv15 import dynamics_kernels as kernels
from rtsim.aircraft.xv15.model import Xv15
from rtsim.lpv.building.build import GridPoint, Guess, Jacobians
from rtsim.lpv.building.grid import NACELLE_DEG
from rtsim.lpv.database import Database
from rtsim.units import DEGREE, KNOT, deg

WING_ALPHA_LIMIT = 16.0 * DEGREE
"""Largest wing angle of attack of an unstalled trim where the wing carries the aircraft [rad]."""
WING_BORNE_AIRSPEED = 60.0 * KNOT
"""Airspeed above which it does; slower, the rotors carry most of the weight and trims pass stall smoothly [m/s]."""
FLYABLE_STICK = 1.0
"""Stick travel: trims beyond the stops are no trims."""
NEIGHBOUR_PITCH, NEIGHBOUR_STICK, NEIGHBOUR_COLLECTIVE = 8.0 * DEGREE, 0.35, 8.0 * DEGREE
"""Largest change from one grid point to the next on one branch [rad, -, rad]."""


CORNER_AIRSPEED, CORNER_NACELLE = 0.1, 1e-3
"""Reach of the finite differences around the corners of the flap schedule [m/s, rad]."""

MODEL_DATA = files(rtsim.aircraft.xv15) / "data"
"""Folder of the nonlinear model's data."""
MODEL_FILES = ("model_choices.toml", "rotor_sections.toml", "xv15_inputs.toml", "xv15_lateral.toml")
"""Data of the nonlinear model, in the order in which they are hashed."""
SAMPLE = 29
"""One trim in so many is checked by ``still_trims``."""
STILL_TRIM = 2e-6
"""Largest residual of a trim that still is one [SI units of the state derivative]."""


@dataclass(frozen=True, slots=True)
class Xv15Grid:
    """The nonlinear XV-15 in the form that ``rtsim.lpv.building.build.build_database`` asks for."""

    aircraft: Xv15 = field(default_factory=Xv15.load)
    """The nonlinear model."""
    condition: AircraftCondition = SHIPPED
    """Its weight, air and centre of gravity."""

    @staticmethod
    def under(condition: AircraftCondition) -> Xv15Grid:
        """The XV-15 at a condition.

        Args:
            condition: Weight, air and centre of gravity.
        """
        return Xv15Grid(Xv15.under(condition), condition)

    @property
    def states(self) -> Sequence[Variable]:
        """The states of the nonlinear model."""
        return STATES

    @property
    def inputs(self) -> Sequence[Variable]:
        """The inputs of the nonlinear model."""
        return INPUTS

    @property
    def outputs(self) -> Sequence[Variable]:
        """The outputs of the nonlinear model."""
        return OUTPUTS

    def rotor_speed(self, nacelle: float) -> float:
        """Rotor speed that is held at a place of the nacelle axis [rad/s]: below 0 it falls to airplane mode's."""
        full = float(self.aircraft.tables.configuration.rotor_speed)
        share = max(-nacelle, 0.0) / -deg(float(NACELLE_DEG[0]))
        return full + share * (self.aircraft.airplane_rotor_speed - full)

    @property
    def attributes(self) -> dict[str, str | float | int]:
        """Title, condition, hash of the aircraft's data, versions."""
        configuration = self.aircraft.tables.configuration
        return {
            "title": "Bell XV-15: trim map and linear models over the conversion corridor",
            "mass_kg": float(configuration.mass),
            "air_density_kg_m3": float(configuration.density),
            **self.condition.attributes,
            "source_sha256": source_sha256(),
            "rtsim_version": rtsim.__version__,
            "numpy_version": np.__version__,
            "numba_version": metadata.version("numba"),
            "machine": platform.machine(),
        }

    def solve(self, airspeed: float, nacelle: float, acceleration: float, guess: Guess | None) -> GridPoint | None:
        """Trim, or None where none is found from this guess.

        Args:
            acceleration: Level acceleration [m/s^2].
            guess: State and input to start from.
        """
        start = None
        if guess is not None:
            start = TrimPoint(guess[0], guess[1], np.zeros(len(OUTPUTS)), np.zeros(len(STATES)), True, 0.0)
        point = self.aircraft.trim(self.condition_at(airspeed, nacelle, acceleration), start)
        return GridPoint(point.x, point.u, point.y, point.xdot) if point.converged else None

    def reject(self, point: GridPoint, airspeed: float, nacelle: float) -> str | None:
        """Say why a trim is stalled or beyond the controls' travel, or None where it is good.

        Args:
            point: The trim.
        """
        del nacelle
        if abs(point.u[INPUT.stick]) > FLYABLE_STICK:
            return "stick beyond its stops"
        if not 0.0 <= point.u[INPUT.lever] <= 1.0:
            return "lever beyond its stops"
        if airspeed > WING_BORNE_AIRSPEED and point.y[OUTPUT.wing_angle_of_attack] > WING_ALPHA_LIMIT:
            return "wing stalled"
        return None

    def far_apart(self, point: GridPoint, neighbour: GridPoint) -> bool:
        """Whether two neighbours differ so much that they cannot be on the same branch.

        Args:
            point: A trim.
            neighbour: The trim it was continued from.
        """
        change_x, change_u = np.abs(point.x - neighbour.x), np.abs(point.u - neighbour.u)
        return bool(
            change_x[STATE.pitch] > NEIGHBOUR_PITCH
            or change_u[INPUT.stick] > NEIGHBOUR_STICK
            or change_x[STATE.collective_75] > NEIGHBOUR_COLLECTIVE
        )

    def jacobians(self, point: GridPoint, airspeed: float, nacelle: float, acceleration: float) -> Jacobians:
        """A, B, C, D and the derivative of the state derivative with nacelle angle, at a trim.

        Args:
            point: The trim.
            acceleration: Its level acceleration [m/s^2].
        """
        trim = TrimPoint(point.x, point.u, point.y, point.xdot, True, 0.0)
        model = flown_model(self.aircraft, self.condition_at(airspeed, nacelle, acceleration), trim)
        return model.A, model.B, model.C, model.D, model.df_dnacelle

    def flap(self, airspeed: float, nacelle: float) -> float:
        """Flap deflection of the schedule [rad]."""
        return float(kernels.flap_schedule(self.aircraft.tables.controls, airspeed, nacelle))

    def near(self, point: TrimPoint, neighbour: TrimPoint, airspeed: float) -> bool:
        """Whether a trim is flyable, unstalled, and on the branch of its neighbour.

        Args:
            point: The trim.
            neighbour: The trim it was continued from.
        """
        found, start = (GridPoint(trim.x, trim.u, trim.y, trim.xdot) for trim in (point, neighbour))
        return self.reject(found, airspeed, 0.0) is None and not self.far_apart(found, start)

    def condition_at(self, airspeed: float, nacelle: float, acceleration: float) -> Condition:
        """The flight condition of a grid point.

        Args:
            nacelle: Place on the nacelle axis: below 0 the rotor speed falls.
            acceleration: Level acceleration [m/s^2].
        """
        return Condition(
            airspeed=airspeed,
            nacelle_angle=max(nacelle, 0.0),
            acceleration=acceleration,
            rotor_speed=self.rotor_speed(nacelle),
        )


def flown_model(aircraft: Xv15, condition: Condition, trim: TrimPoint) -> LinearModel:
    """Linear model as it is flown: at a corner of the flap schedule, of the side where the flap does not move.

    Args:
        aircraft: The nonlinear model.
        trim: The trim found there.
    """
    model = aircraft.linearize(condition, trim)
    if condition.flap is not None:
        return model
    # The flap schedule has corners on the downstop; a difference across one would be half a slope that is flown
    # nowhere. There the flap is frozen, which is the derivative on the side where it does not move.
    airspeed, nacelle, controls = condition.airspeed, condition.nacelle_angle, aircraft.tables.controls
    if nacelle <= controls.downstop_nacelle + CORNER_NACELLE:
        flap = float(kernels.flap_schedule(controls, airspeed, nacelle))
        frozen = aircraft.linearize(replace(condition, flap=flap), trim)
        if np.min(np.abs(controls.flap_retraction - airspeed)) < CORNER_AIRSPEED:
            model = frozen
        model = replace(model, df_dnacelle=frozen.df_dnacelle)
    return model


def source_sha256() -> str:
    """Hash the aircraft's data files, as numbers: comments and layout do not count.

    Returns:
        SHA-256 as 64 hexadecimal digits.
    """
    digest = hashlib.sha256()
    for name in MODEL_FILES:
        digest.update(name.encode())
        digest.update(repr(tomllib.loads((MODEL_DATA / name).read_text("utf-8"))).encode())
    return digest.hexdigest()


def still_trims(database: Database) -> bool:
    """Whether the stored trims are still trims of the nonlinear model: its code may have changed with the same data.

    Args:
        database: A database built from the XV-15.

    Returns:
        Whether state derivatives and outputs at sampled trims are what the database says.
    """
    aircraft = Xv15.under(AircraftCondition.stored(database.attributes))
    if (database.states, database.inputs, database.outputs) != (STATES, INPUTS, OUTPUTS):
        return False
    for cell in map(tuple, np.argwhere(database.valid)[::SAMPLE]):
        x, u, nacelle = database.x_ref[cell], database.u_ref[cell].copy(), max(float(database.nacelle[cell[2]]), 0.0)
        u[INPUT.rotor_speed] = database.rotor_speed[cell[2]] - aircraft.tables.configuration.rotor_speed
        rate, y = aircraft.derivative(x, u, nacelle), aircraft.outputs(x, u, nacelle)
        if np.max(np.abs(rate - database.xdot_ref[cell])) > STILL_TRIM:
            return False
        if not np.allclose(y, database.y_ref[cell], rtol=STILL_TRIM, atol=STILL_TRIM):
            return False
    return True
