"""The conversion-path problem: numbers in the unit box to a path, its flights, and what they are worth."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.loop.aircraft import database_of
from rtsim.loop.option_tables import given
from rtsim.loop.options import FlightOptions
from rtsim.loop.setup import FlightSetup
from rtsim.measures.metrics import FlightFigures, objective_value
from rtsim.optimization.batch import BatchFlight, BatchFlyer
from rtsim.optimization.path import ConversionPath, path_through
from rtsim.optimization.paths import PATH_NAMES, conversion_end_kt, paper_path
from rtsim.optimization.spec import SearchSpec

NACELLE_START_DEG = 90.0
COORDINATE_DIGITS = 3
"""Points are rounded to a thousandth of a knot or degree, so that scenario files read well."""
CONSTRAINTS = (
    "completed",
    "margin",
    "altitude",
    "pitch",
    "airspeed",
    "flapping",
    "stops",
    "arrival",
    "duration",
    "torque",
)
"""Names of the constraints, in the order of the columns of ``Evaluation.constraints``; each holds at or below 0."""
UNFINISHED = 100.0
"""Constraint value of a flight that did not reach its end, before the missing share is added."""
FIRST_ROBUST_SEED = 1000


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Candidates and what they are worth."""

    variables: FloatArray
    """Shape (candidates, variables), in the unit box."""
    objectives: FloatArray
    """Shape (candidates, objectives), to be minimized."""
    constraints: FloatArray
    """Shape (candidates, len(CONSTRAINTS)); a value above 0 is a violation, in shares of the limit."""

    @property
    def violation(self) -> FloatArray:
        """Sum of the violations, shape (candidates,); 0 where a candidate is feasible."""
        return np.asarray(np.maximum(self.constraints, 0.0).sum(axis=1), dtype=np.float64)


class ConversionProblem:
    """N free points between hover and airplane mode, up to where the aircraft's conversions end.

    The variables are the airspeeds and the nacelle angles of the points as shares of their ranges. They are sorted, so
    that every vector of the unit box is a conversion: airspeed never falls and the nacelles never tilt back.
    """

    def __init__(self, spec: SearchSpec, *, workers: int | None = None) -> None:
        """Load the aircraft.

        Args:
            spec: What is searched.
            workers: Threads that fly; None takes one for every core.

        Raises:
            InputError: The database cannot be used.
        """
        self.spec = spec
        options = FlightOptions(**given(spec.flight), protection="off")
        self.aircraft = database_of(options.aircraft)
        self.final_airspeed_kt = conversion_end_kt(self.aircraft)
        self.variables = 2 * spec.points
        air, noise = AirSpecification(), False
        if spec.robust.flights:
            noise = spec.robust.pilot_noise
            if spec.robust.turbulence is not None:
                air = AirSpecification(turbulence=Turbulence.of_severity(spec.robust.turbulence))
        start = self.path(np.full(self.variables, 0.5))
        self.setup = FlightSetup(
            programme=start.programme(spec.flight.altitude_m),
            options=options.changed({"pilot_noise": noise}),
            air=air,
        )
        self._flyer = BatchFlyer(self.setup, workers=workers)

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the flights that judge each candidate; the same for all (common random numbers)."""
        return tuple(range(FIRST_ROBUST_SEED, FIRST_ROBUST_SEED + self.spec.robust.flights)) or (0,)

    @property
    def has_nonlinear_model(self) -> bool:
        """Whether a path can be checked on the nonlinear model."""
        return self.aircraft.profile.is_xv15

    @property
    def database_hash(self) -> str:
        """Hash of the aircraft's database and profile."""
        return self._flyer.database_hash

    def path(self, variables: FloatArray) -> ConversionPath:
        """The path that a vector stands for.

        Args:
            variables: Shape (variables,), in the unit box.
        """
        spec = self.spec
        count = spec.points
        clipped = np.clip(variables, 0.0, 1.0)
        airspeed = np.round(np.sort(clipped[:count]) * self.final_airspeed_kt, COORDINATE_DIGITS)
        nacelle = np.round(-np.sort(-clipped[count:]) * NACELLE_START_DEG, COORDINATE_DIGITS)
        corners = [(0.0, NACELLE_START_DEG)]
        corners += [(float(v), float(n)) for v, n in zip(airspeed, nacelle, strict=True)]
        corners.append((self.final_airspeed_kt, 0.0))
        return path_through(
            spec.name,
            f"Conversion found by search: least {', '.join(spec.objectives)}",
            corners,
            nacelle_rate_deg_s=spec.nacelle_rate_deg_s,
            caps=spec.acceleration.caps(),
            hold_s=spec.hold_s,
            nacelle_motion=spec.nacelle_motion,
        )

    def encode(self, path: ConversionPath) -> FloatArray:
        """The vector whose path comes nearest to a given one.

        With as many free points as the path has corners between its ends, these are taken over; otherwise points are
        laid along it at equal distances.

        Args:
            path: A conversion from hover to where the aircraft's conversions end.
        """
        corners = np.array(
            [[p.airspeed_kt / self.final_airspeed_kt, p.nacelle_deg / NACELLE_START_DEG] for p in path.points]
        )
        if len(corners) - 2 == self.spec.points:
            inner = corners[1:-1]
        else:
            length = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
            at = np.linspace(0.0, length[-1], self.spec.points + 2)[1:-1]
            inner = np.stack([np.interp(at, length, corners[:, column]) for column in range(2)], axis=1)
        return np.concatenate((inner[:, 0], inner[:, 1]))

    def baselines(self) -> dict[str, ConversionPath]:
        """The paper's paths within this search's constraint set: its nacelle rate, and the smaller of both caps."""
        spec = self.spec
        paths = {}
        for name in PATH_NAMES:
            own = paper_path(name, nacelle_rate_deg_s=spec.nacelle_rate_deg_s, aircraft=self.aircraft)
            if name == "centre_line_variable" and spec.nacelle_rate_deg_s < 12.0:
                continue  # without its rate it is the centre line
            capped = own.with_rates(
                nacelle_rate_deg_s=spec.nacelle_rate_deg_s, caps=spec.acceleration.caps(), name=own.name
            )
            points = [
                dataclasses.replace(new, acceleration_kt_s=min(new.acceleration_kt_s, old.acceleration_kt_s))
                for new, old in zip(capped.points, own.points, strict=True)
            ]
            points[-1] = dataclasses.replace(points[-1], hold_s=spec.hold_s)
            paths[name] = dataclasses.replace(capped, points=tuple(points))
        return paths

    def fly(self, paths: Sequence[ConversionPath]) -> list[list[FlightFigures]]:
        """Fly paths as the search flies its candidates.

        Args:
            paths: The paths.

        Returns:
            Per path the figures of its flights, one for every seed.
        """
        altitude = self.spec.flight.altitude_m
        flights = [BatchFlight(path.programme(altitude), seed) for path in paths for seed in self.seeds]
        figures = self._flyer.fly(flights)
        count = len(self.seeds)
        return [figures[k * count : (k + 1) * count] for k in range(len(paths))]

    def worth(self, path: ConversionPath, figures: Sequence[FlightFigures]) -> tuple[list[float], list[float]]:
        """Objectives and constraints of one path from its flights.

        Args:
            path: The path.
            figures: Its flights; with several, the objectives are mean + weight * standard deviation over them and
                every constraint is that of the worst flight.
        """
        planned = path.programme(self.spec.flight.altitude_m).duration
        constraints = [self._constraints(flight, planned) for flight in figures]
        worst = [max(column) for column in zip(*constraints, strict=True)]
        objectives = []
        for objective in self.spec.objectives:
            values = [objective_value(flight, objective) for flight in figures]
            mean = math.fsum(values) / len(values)
            spread = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / len(values))
            weight = self.spec.robust.spread_weight if len(values) > 1 else 0.0
            value = mean + weight * spread
            # A flight cut short sums up less: it must not look better for it.
            objectives.append(value if worst[0] <= 0.0 else abs(value) + 1e6)
        return objectives, worst

    def evaluate(self, variables: FloatArray) -> Evaluation:
        """Fly candidates.

        Args:
            variables: Shape (candidates, variables).
        """
        paths = [self.path(row) for row in variables]
        worths = [self.worth(path, figures) for path, figures in zip(paths, self.fly(paths), strict=True)]
        return Evaluation(
            np.array(variables, dtype=np.float64),
            np.array([objectives for objectives, _ in worths]),
            np.array([constraints for _, constraints in worths]),
        )

    def _constraints(self, flight: FlightFigures, planned: float) -> list[float]:
        limits = self.spec.limits
        tight = self.spec.robust if self.spec.robust.flights else limits
        missing = max(0.0, 1.0 - flight.duration_s / planned) if planned > 0.0 else 0.0
        pitch = max(abs(flight.pitch_min_deg), abs(flight.pitch_max_deg))
        arrival = 1.0 if not self.spec.robust.flights else tight.airspeed_error_kt
        return [
            0.0 if flight.completed else UNFINISHED * (1.0 + missing),
            (tight.margin_kt - flight.worst_margin_kt) / 10.0,
            flight.altitude_deviation_m / tight.altitude_m - 1.0,
            pitch / tight.pitch_deg - 1.0,
            flight.airspeed_max_error_kt / tight.airspeed_error_kt - 1.0,
            flight.flapping_peak_deg / tight.flapping_deg - 1.0,
            flight.controls_on_stop_frames / self.setup.options.rate_hz,
            max(abs(flight.airspeed_final_kt - self.final_airspeed_kt) - arrival, flight.nacelle_final_deg - 0.5),
            flight.duration_s / limits.duration_s - 1.0 if limits.duration_s is not None else 0.0,
            flight.mast_torque_max_inlb / limits.mast_torque_inlb - 1.0 if limits.mast_torque_inlb is not None else 0.0,
        ]
