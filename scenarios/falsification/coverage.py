"""What part of the space was flown: by class, by coordinate, by place in the corridor; and what was never tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.arrays import BoolArray, FloatArray
from rtsim.corridor.boundaries import Corridor
from rtsim.drawing import drawing
from rtsim.loop.aircraft import database_of
from rtsim.protection.boundary import load_boundary
from rtsim.units import deg, to_kt
from scenarios.campaign.chunks import Task, task_spec
from scenarios.falsification.archive import Archive
from scenarios.falsification.evaluation import AIRSPEED_CELLS, AIRSPEED_STEP_KT, NACELLE_CELLS, NACELLE_STEP_DEG
from scenarios.falsification.space import ClassSpace

PARTS = 10
"""Parts of a coordinate's range that are told apart."""
NEVER_SHOWN = 20
"""Examples of what was never tried."""


@dataclass(frozen=True, slots=True, eq=False)
class ClassCoverage:
    """What of a class was flown."""

    name: str
    """The class."""
    flights: int
    """Flights."""
    least: tuple[float, ...]
    """Least robustness, by property; inf of none."""
    places: tuple[str, ...]
    """Its coordinates."""
    counts: FloatArray
    """Flights in each part of each coordinate, shape (coordinates, PARTS)."""


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """What was flown."""

    classes: tuple[ClassCoverage, ...]
    """By class."""
    flown: FloatArray
    """Flights through each cell of nacelle angle and airspeed, shape (NACELLE_CELLS, AIRSPEED_CELLS)."""
    inside: BoolArray
    """Cells inside the corridor."""
    worst: FloatArray
    """Nacelle angle [deg], airspeed [kn] and robustness of the first property, of every flight, shape (flights, 3)."""
    corridor: Corridor
    """The corridor."""

    def report(self) -> dict[str, Any]:
        """It as JSON values."""
        never = [
            {"class": one.name, "coordinate": place, "from": part / PARTS, "to": (part + 1) / PARTS}
            for one in self.classes
            for place, counts in zip(one.places, one.counts, strict=True)
            for part in np.flatnonzero(counts == 0.0).tolist()
        ]
        cells = [
            {"nacelle_deg": nacelle * NACELLE_STEP_DEG, "airspeed_kt": airspeed * AIRSPEED_STEP_KT}
            for nacelle, airspeed in np.argwhere(self.inside & (self.flown == 0.0)).tolist()
        ]
        return {
            "corridor_cells": int(self.inside.sum()),
            "corridor_cells_flown": int((self.inside & (self.flown > 0.0)).sum()),
            "corridor_cells_never": cells,
            "classes": [
                {
                    "name": one.name,
                    "flights": one.flights,
                    "coordinates": len(one.places),
                    "parts_tried": float((one.counts > 0.0).mean()) if one.counts.size else 1.0,
                    "robustness_min": list(one.least),
                }
                for one in self.classes
            ],
            "never_tried": {"count": len(never), "examples": never[:NEVER_SHOWN]},
        }

    def draw(self, path: Path) -> None:
        """Draw it.

        Args:
            path: The picture; its ending says what kind.
        """
        with drawing(**{"font.size": 9.0}):
            from matplotlib.figure import Figure

            rows = max((len(one.places) for one in self.classes), default=1)
            figure = Figure(figsize=(14.0, min(max(6.5, 0.14 * rows + 3.0), 16.0)), layout="constrained")
            halves = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.2))
            self._draw_corridor(figure.add_subplot(halves[0]), figure)
            drawn = [one for one in self.classes if one.places]
            heights = [len(one.places) + 2 for one in drawn] or [1]
            grid = halves[1].subgridspec(max(len(drawn), 1), 1, height_ratios=heights)
            for number, one in enumerate(drawn):
                _draw_class(figure.add_subplot(grid[number]), one, last=number == len(drawn) - 1)
            figure.savefig(path, dpi=110)

    def _draw_corridor(self, axes: Any, figure: Any) -> None:
        from matplotlib.colors import LogNorm

        airspeeds = np.arange(AIRSPEED_CELLS + 1) * AIRSPEED_STEP_KT
        nacelles = (np.arange(NACELLE_CELLS + 1) - 0.5) * NACELLE_STEP_DEG
        shown = np.ma.masked_equal(self.flown, 0.0)
        if self.flown.any():
            mesh = axes.pcolormesh(
                airspeeds, nacelles, shown, cmap="Blues", norm=LogNorm(1.0, max(float(self.flown.max()), 2.0))
            )
            figure.colorbar(mesh, ax=axes, label="flights through the cell", orientation="horizontal", shrink=0.8)
        for nacelle, airspeed in np.argwhere(self.inside & (self.flown == 0.0)):
            axes.plot((airspeed + 0.5) * AIRSPEED_STEP_KT, nacelle * NACELLE_STEP_DEG, "x", color="#c77700", ms=4)
        angles = np.linspace(0.0, 90.0, 181)
        low, high = (np.array([_side(self.corridor, angle)[side] for angle in angles]) for side in (0, 1))
        axes.plot(low, angles, color="#333333", linewidth=1.3)
        axes.plot(high, angles, color="#333333", linewidth=1.3)
        if len(self.worst):
            broken = self.worst[:, 2] < 0.0
            axes.plot(self.worst[~broken, 1], self.worst[~broken, 0], ".", color="#1f5fa8", ms=3, alpha=0.5)
            axes.plot(self.worst[broken, 1], self.worst[broken, 0], "o", color="#c62828", ms=5)
        axes.set(xlabel="airspeed [kn]", ylabel="nacelle angle [deg]", xlim=(0, 240), ylim=(-2, 92))
        axes.set_title("where it was flown; least margin of each flight (red: broken; x: never)", fontsize=9)


def coverage_of(task: Task, spaces: Sequence[ClassSpace], archive: Archive) -> Coverage:
    """Account for everything flown.

    Args:
        task: What flew.
        spaces: The classes that were searched.
        archive: What was flown.
    """
    spec = task_spec(task.text, task.file)
    corridor = load_boundary(spec.corridor, database_of(task.options.aircraft))
    flown = np.zeros((NACELLE_CELLS, AIRSPEED_CELLS))
    for one in archive.flown:
        bits = np.unpackbits(np.frombuffer(one.answer.cells, dtype=np.uint8))[: flown.size]
        flown += bits.reshape(flown.shape)
    worst = [(one.answer.nacelle_deg, one.answer.airspeed_kt, one.answer.robustness[0]) for one in archive.flown]
    classes = tuple(_class(space, archive, len(task.properties)) for space in spaces)
    return Coverage(classes, flown, _inside(corridor), np.array(worst).reshape(-1, 3), corridor)


def _class(space: ClassSpace, archive: Archive, properties: int) -> ClassCoverage:
    flights = [one for one in archive.flown if one.query.class_number == space.number]
    vectors = np.array([one.query.vector for one in flights]).reshape(len(flights), space.size)
    parts = np.minimum((vectors * PARTS).astype(int), PARTS - 1)
    counts = np.array([np.bincount(column, minlength=PARTS) for column in parts.T], dtype=np.float64)
    least = np.array([one.answer.robustness for one in flights]).reshape(len(flights), properties)
    return ClassCoverage(
        name=space.name,
        flights=len(flights),
        least=tuple(least.min(axis=0, initial=np.inf).tolist()),
        places=tuple(one.place for one in space.coordinates),
        counts=counts.reshape(space.size, PARTS),
    )


def _side(corridor: Corridor, nacelle_deg: float) -> tuple[float, float]:
    """Low and high side of the corridor at a nacelle angle [kn]."""
    angle = deg(nacelle_deg)
    return to_kt(float(corridor.low_speed(angle))), to_kt(float(corridor.high_speed(angle)))


def _inside(corridor: Corridor) -> BoolArray:
    found = np.zeros((NACELLE_CELLS, AIRSPEED_CELLS), dtype=np.bool_)
    for nacelle in range(NACELLE_CELLS):
        low, high = _side(corridor, nacelle * NACELLE_STEP_DEG)
        middles = (np.arange(AIRSPEED_CELLS) + 0.5) * AIRSPEED_STEP_KT
        found[nacelle] = (middles >= low) & (middles <= high)
    return found


def _draw_class(axes: Any, one: ClassCoverage, *, last: bool) -> None:
    axes.imshow(np.ma.masked_equal(one.counts, 0.0), aspect="auto", cmap="Blues", vmin=0.0)
    for row, part in np.argwhere(one.counts == 0.0):
        axes.plot(part, row, "x", color="#c77700", ms=3)
    least = f", least robustness {one.least[0]:.3g}" if one.flights else ""
    axes.set_title(f"{one.name}: {one.flights} flights{least}", fontsize=9, loc="left")
    step = max(1, len(one.places) // 12)
    axes.set_yticks(range(0, len(one.places), step), one.places[::step], fontsize=6)
    axes.set_xticks(
        range(PARTS) if last else [], [f"{10 * part} %" for part in range(PARTS)] if last else [], fontsize=7
    )
