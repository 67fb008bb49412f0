"""Designs the pilot's lateral half at every grid point: the same machinery, other displays and hands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from rtsim.lpv.database import Database
from rtsim.lpv.lateral import LateralData
from rtsim.pilot.design import MocmDesign
from rtsim.pilot.lateral_plant import DISPLAYS, STATES, LateralPlant, lateral_plant
from rtsim.pilot.problem import MocmError, MocmProblem, build_problem
from rtsim.pilot.schedule import ScheduledPilot, design_point, fill_cells, rounded_gains
from rtsim.pilot.weights import LateralPilotSettings, lateral_pilot_settings
from rtsim.worker_pool import work

LATERAL = "lateral"
"""Name of the design in a database."""


def lateral_problem(plant: LateralPlant, settings: LateralPilotSettings) -> MocmProblem:
    """State the design problem of one grid point.

    Args:
        plant: The design plant.
        settings: Weights and noises.
    """
    shown = settings.displays
    integrals = [settings.integral_time * display.maximum for display in (settings.heading, settings.lateral_velocity)]
    return build_problem(
        {
            "A": plant.A,
            "B": plant.B,
            "C": plant.C,
            "E": plant.E,
            "q_y": [1.0 / maximum**2 for maximum in (*(display.maximum for display in shown), *integrals)],
            "tau": settings.delay,
            "tau_n": [settings.lateral_stick_lag, settings.pedal_lag],
            "rho_y": [*(display.noise_ratio for display in shown), *[settings.integral_noise_ratio] * 2],
            "f": [*(display.attention for display in shown), 1.0, 1.0],
            "threshold": [*(display.threshold for display in shown), 0.0, 0.0],
            "rho_u": settings.motor_noise_ratio,
        }
    )


def _design_row(
    database: Database, settings: LateralPilotSettings, nacelle: int
) -> list[tuple[int, LateralPlant, MocmDesign | None]]:
    data = LateralData.of(database)
    row: list[tuple[int, LateralPlant, MocmDesign | None]] = []
    neighbour: MocmDesign | None = None
    for v in np.flatnonzero(database.valid[database.level_layer, :, nacelle]):
        plant = lateral_plant(data, (int(v), nacelle), float(database.airspeed[v]), settings)
        design: MocmDesign | None
        try:
            design = design_point(lateral_problem(plant, settings), neighbour)
        except MocmError:
            design = None  # the cell is marked and filled
        neighbour = design if design is not None else neighbour
        row.append((int(v), plant, design))
    return row


def design_lateral(
    database: Database,
    *,
    settings: LateralPilotSettings | None = None,
    jobs: int = 1,
    progress: Callable[[float], None] | None = None,
) -> ScheduledPilot:
    """Design the lateral half at every valid point of the database.

    Args:
        database: One with a lateral half.
        settings: Weights and noises; None: the aircraft's.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the share of the work done since the last call; the shares add up to 1.

    Raises:
        MocmError: At some nacelle angle no pilot could be designed at all.
    """
    chosen = settings if settings is not None else lateral_pilot_settings(database.profile)
    arrays: dict[str, Any] = {}
    shape = (database.airspeed.size, database.nacelle.size)
    valid = np.zeros(shape)
    pieces = [(database, chosen, number) for number in range(shape[1])]
    for nacelle, row in enumerate(work(_design_row, pieces, jobs=jobs)):
        for v, plant, design in row:
            if design is None:
                continue
            valid[v, nacelle] = 1.0
            for name, value in _point_arrays(plant, design).items():
                arrays.setdefault(name, np.zeros(shape + value.shape))[v, nacelle] = value
        if progress is not None:
            progress(1.0 / shape[1])
    fill_cells(arrays, valid, database)
    attributes: dict[str, str | float | int] = {
        "outer_loop": "integrators", "states": " ".join(STATES), "displays": " ".join(DISPLAYS), "pade_order": 2,
        "pade_kind": "pade",
    }  # fmt: skip
    for name, value in asdict(chosen).items():
        entries = (
            {f"{name}_{key}": number for key, number in value.items()} if isinstance(value, dict) else {name: value}
        )
        attributes |= {key: float(number) for key, number in entries.items()}
    return ScheduledPilot(
        outer_loop="integrators", states=STATES, displays=DISPLAYS, valid=valid, attributes=attributes,
        **rounded_gains(arrays),
    )  # fmt: skip


def _point_arrays(plant: LateralPlant, design: MocmDesign) -> dict[str, Any]:
    return {
        "A": plant.A,
        "B": plant.B,
        "C": plant.C,
        "nacelle_effect": np.zeros((len(STATES), 2)),
        "l": design.regulator.l,
        "G2": design.regulator.G2,
        "F": design.estimator.F,
        "V_y": design.estimator.V_y,
        "V_u": design.estimator.V_u,
        "g": design.regulator.g,
    }
