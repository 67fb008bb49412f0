"""Designs the pilot at every grid point of the level layer, for both ways to hold airspeed and altitude."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.choices import OuterLoop
from rtsim.lpv.cells import JACOBIAN_BITS, round_mantissa
from rtsim.lpv.database import Database, StoredArrays
from rtsim.pilot.design import MocmDesign, design_problem
from rtsim.pilot.design_plant import DesignPlant, PlantLayout, design_plant, plant_layout
from rtsim.pilot.problem import MocmError, MocmProblem, build_problem
from rtsim.pilot.weights import PilotSettings, pilot_settings
from rtsim.worker_pool import work

ARRAYS = ("A", "B", "C", "nacelle_effect", "l", "G2", "F", "V_y", "V_u", "g", "valid")
"""Arrays of a scheduled pilot, leading axes [airspeed, nacelle]."""


@dataclass(frozen=True, slots=True)
class ScheduledPilot:
    """Gains of one pilot over the grid; leading axes [airspeed, nacelle]. SI and radians."""

    outer_loop: OuterLoop
    """How airspeed and altitude are held."""
    states: tuple[str, ...]
    """Names of the n states of the design plant."""
    displays: tuple[str, ...]
    """Names of the ny displays."""
    A: FloatArray
    """Design plant [..., n, n]."""
    B: FloatArray
    """Its controls [..., n, nu]."""
    C: FloatArray
    """Its displays [..., ny, n]."""
    nacelle_effect: FloatArray
    """Effect of nacelle rate and acceleration [..., n, 2]."""
    l: FloatArray  # noqa: E741  # the literature's symbol
    """Commanded-control gain on plant and delay states [..., nu, n + nd]."""
    G2: FloatArray
    """Inverse neuromotor lag [..., nu, nu]."""
    F: FloatArray
    """Filter gain [..., n + nd + nu, ny]."""
    V_y: FloatArray
    """Intensity of the observation noise [..., ny]."""
    V_u: FloatArray
    """Intensity of the motor noise [..., nu]."""
    g: FloatArray
    """Weights of the squared control rates [..., nu]."""
    valid: FloatArray
    """1 where a pilot was designed, 0 where the cell was filled from the nearest airspeed [...]."""
    attributes: Mapping[str, str | float | int]
    """Settings of the design."""

    def to_arrays(self) -> StoredArrays:
        """Give the pilot as named arrays with attributes, as the database file stores it."""
        return StoredArrays({name: getattr(self, name) for name in ARRAYS}, dict(self.attributes))

    @staticmethod
    def from_arrays(stored: StoredArrays) -> ScheduledPilot:
        """Take a pilot from named arrays.

        Args:
            stored: Arrays and attributes, as written by ``to_arrays``.

        Returns:
            The pilot.
        """
        attributes = stored.attributes
        outer_loop: OuterLoop = "pi" if attributes["outer_loop"] == "pi" else "integrators"
        return ScheduledPilot(
            outer_loop=outer_loop,
            states=tuple(str(attributes["states"]).split()),
            displays=tuple(str(attributes["displays"]).split()),
            attributes=dict(attributes),
            **{name: stored.arrays[name] for name in ARRAYS},
        )


def point_problem(plant: DesignPlant, settings: PilotSettings, *, integrators: bool) -> MocmProblem:
    """State the design problem of one grid point.

    Args:
        plant: The design plant.
        settings: Weights and noises.
        integrators: Whether the plant's last two displays are the integrals.

    Returns:
        The checked problem.
    """
    maxima = [display.maximum for display in settings.displays]
    threshold = [display.threshold for display in settings.displays]
    attention = [display.attention for display in settings.displays]
    noise = [display.noise_ratio for display in settings.displays]
    if integrators:
        maxima += [settings.integral_time * maximum for maximum in maxima[:2]]
        threshold += [0.0, 0.0]
        attention += [1.0, 1.0]
        noise += [settings.integral_noise_ratio] * 2
    return build_problem(
        {
            "A": plant.A,
            "B": plant.B,
            "C": plant.C,
            "E": plant.E,
            "q_y": [1.0 / maximum**2 for maximum in maxima],
            "tau": settings.delay,
            "tau_n": [settings.stick_lag, settings.lever_lag],
            "rho_y": noise,
            "f": attention,
            "threshold": threshold,
            "rho_u": settings.motor_noise_ratio,
        }
    )


def design_point(problem: MocmProblem, neighbour: MocmDesign | None) -> MocmDesign:
    """Design from the neighbour, or from nothing where that start leads astray.

    Args:
        problem: What is asked.
        neighbour: Design of the grid point before, or None.
    """
    if neighbour is not None:
        try:
            return design_problem(problem, start=neighbour)
        except MocmError:
            pass
    return design_problem(problem)


def _design_row(
    database: Database, layout: PlantLayout, settings: PilotSettings, nacelle: int
) -> list[tuple[int, int, DesignPlant, MocmDesign | None]]:
    """Design all airspeeds of one nacelle angle, each from its slower neighbour."""
    level = database.level_layer
    row: list[tuple[int, int, DesignPlant, MocmDesign | None]] = []
    neighbour: MocmDesign | None = None
    for v in np.flatnonzero(database.valid[level, :, nacelle]):
        plant = design_plant(database, layout, where=(level, int(v), nacelle), settings=settings)
        design: MocmDesign | None
        try:
            problem = point_problem(plant, settings, integrators=layout.integrators)
            design = design_point(problem, neighbour)
        except MocmError:
            design = None  # the cell is marked and filled; the map in docs/pilot.md shows it
        neighbour = design if design is not None else neighbour
        row.append((int(v), nacelle, plant, design))
    return row


def _rows(
    database: Database, layout: PlantLayout, settings: PilotSettings, jobs: int
) -> Iterator[list[tuple[int, int, DesignPlant, MocmDesign | None]]]:
    pieces = [(database, layout, settings, number) for number in range(database.nacelle.size)]
    yield from work(_design_row, pieces, jobs=jobs)


def design_schedule(
    database: Database,
    *,
    outer_loop: OuterLoop = "integrators",
    settings: PilotSettings | None = None,
    jobs: int = 1,
    progress: Callable[[float], None] | None = None,
) -> ScheduledPilot:
    """Design the pilot at every valid point of the database's level layer.

    Args:
        outer_loop: How airspeed and altitude are held.
        settings: Weights and noises; None: the aircraft's.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the share of the work done since the last call; the shares add up to 1.

    Returns:
        The gains; cells without a design are filled from the nearest airspeed at the same nacelle angle.

    Raises:
        MocmError: At some nacelle angle no pilot could be designed at all.
    """
    chosen = settings if settings is not None else pilot_settings(database.profile)
    layout = plant_layout(database, integrators=outer_loop == "integrators")
    arrays: dict[str, Any] = {}
    shape = (database.airspeed.size, database.nacelle.size)
    valid = np.zeros(shape)
    for row in _rows(database, layout, chosen, jobs):
        for v, nacelle, plant, design in row:
            if design is None:
                continue
            valid[v, nacelle] = 1.0
            for name, value in _point_arrays(plant, design).items():
                arrays.setdefault(name, np.zeros(shape + value.shape))[v, nacelle] = value
        if progress is not None:
            progress(1.0 / shape[1])
    fill_cells(arrays, valid, database)
    return ScheduledPilot(
        outer_loop=outer_loop,
        states=layout.states,
        displays=layout.displays,
        valid=valid,
        attributes=_attributes(chosen, layout, outer_loop),
        **rounded_gains(arrays),
    )


def rounded_gains(arrays: Mapping[str, Any]) -> dict[str, FloatArray]:
    """Six significant digits, as the database's derivatives: what is flown from memory and from the file is the same.

    Args:
        arrays: Gains by name.
    """
    return {name: round_mantissa(value, JACOBIAN_BITS) for name, value in arrays.items()}


def _point_arrays(plant: DesignPlant, design: MocmDesign) -> dict[str, FloatArray]:
    return {
        "A": plant.A,
        "B": plant.B,
        "C": plant.C,
        "nacelle_effect": plant.nacelle,
        "l": design.regulator.l,
        "G2": design.regulator.G2,
        "F": design.estimator.F,
        "V_y": design.estimator.V_y,
        "V_u": design.estimator.V_u,
        "g": design.regulator.g,
    }


def fill_cells(arrays: dict[str, Any], valid: FloatArray, database: Database) -> None:
    """Copy the nearest designed airspeed of the same nacelle angle into cells without a design.

    Args:
        arrays: Arrays with leading axes [airspeed, nacelle], changed in place.
        valid: 1 where a pilot was designed.
        database: Says the airspeeds.
    """
    for nacelle in range(valid.shape[1]):
        good = np.flatnonzero(valid[:, nacelle] > 0.0)
        if not good.size:
            raise MocmError(
                "E_NO_CONVERGENCE", "no pilot could be designed at this nacelle angle", key="nacelle",
                value=float(database.nacelle[nacelle]), mend="check the linear models there",
            )  # fmt: skip
        for v in np.flatnonzero(valid[:, nacelle] == 0.0):
            source = good[np.argmin(np.abs(database.airspeed[good] - database.airspeed[v]))]
            for array in arrays.values():
                array[v, nacelle] = array[source, nacelle]


def _attributes(settings: PilotSettings, layout: PlantLayout, outer_loop: OuterLoop) -> dict[str, str | float | int]:
    flat: dict[str, str | float | int] = {
        "outer_loop": outer_loop,
        "states": " ".join(layout.states),
        "displays": " ".join(layout.displays),
        "pade_order": 2,
        "pade_kind": "pade",
    }
    for name, value in asdict(settings).items():
        if isinstance(value, dict):
            flat |= {f"{name}_{key}": float(number) for key, number in value.items()}
        else:
            flat[name] = float(value)
    return flat
