"""The flights that the paper's figures need, each flown by several variants of aircraft and pilot."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from rtsim.aircraft.profile import xv15_profile
from rtsim.arrays import FloatArray
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.choices import OuterLoop, PlantName
from rtsim.frame import SIGNAL_NAMES
from rtsim.loop.setup import FlightSetup, build_parts
from rtsim.loop.simulation import Simulation
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.path import TABLE_1_CAPS, ConversionPath
from rtsim.optimization.paths import centre_line, centre_line_variable, fast_side, near_stall, table_1
from rtsim.pilot.layout_kernels import PilotTables
from rtsim.pilot.weights import PilotSettings, pilot_settings
from rtsim.programme import Programme

RATE_HZ = 250
"""Frames per second of every flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """Who flies what: the same flights by another aircraft model or pilot show what a result depends on."""

    name: str
    """Short name."""
    title: str
    """For people."""
    plant: PlantName = "lpv"
    """Aircraft model."""
    outer_loop: OuterLoop = "integrators"
    """How the pilot holds airspeed and altitude."""
    pilot: PilotSettings | None = None
    """Pilot settings other than the aircraft's; the gains are then designed anew."""
    turbulence: float = 0.0
    """Wind at 20 ft that sets the turbulence [m/s]; 0 is calm."""
    seed: int = 0
    """Root of the turbulence."""
    database: str = ""
    """LPV database that is flown, a file; empty: the shipped XV-15."""


SLOW_PILOT = dataclasses.replace(pilot_settings(xv15_profile()), delay=0.25)

BASELINE = Variant(name="baseline", title="layered LPV, MOCM with integrators")
VARIANTS: tuple[Variant, ...] = (
    BASELINE,
    Variant(name="nonlinear", title="the nonlinear model", plant="nonlinear"),
    Variant(name="two-variable", title="the paper's two-variable LPV", plant="lpv-plain"),
    Variant(name="pi", title="the paper's outer PI loops", outer_loop="pi"),
    Variant(name="slow-pilot", title="a pilot with 0.25 s of delay", pilot=SLOW_PILOT),
)
"""What every claim about a flight is judged on; the first one counts, the others show how far it carries."""


def paper_paths(database: str = "") -> dict[str, ConversionPath]:
    """The paths of the paper's figures by name, and three more that show causes.

    Args:
        database: LPV database whose trims the path of least flapping follows, a file; empty: the shipped XV-15.
    """
    aircraft = load_database(database) if database else None
    hurried = fast_side(caps=TABLE_1_CAPS, aircraft=aircraft)
    return {
        "typical": dataclasses.replace(table_1(), name="typical", nacelle_motion="spread"),
        "typical_3deg": dataclasses.replace(table_1(nacelle_rate_deg_s=3.0), name="typical_3deg"),
        "typical_8deg": dataclasses.replace(table_1(nacelle_rate_deg_s=8.0), name="typical_8deg"),
        "fast_side": fast_side(aircraft=aircraft),
        "near_stall": near_stall(),
        "centre_line": centre_line(),
        "centre_line_variable": centre_line_variable(),
        "fast_side_table_1_caps": dataclasses.replace(hurried, name="fast_side_table_1_caps"),
        "near_stall_table_1_caps": dataclasses.replace(near_stall(caps=TABLE_1_CAPS), name="near_stall_table_1_caps"),
        "centre_line_variable_3": dataclasses.replace(
            centre_line_variable(acceleration_kt_s=3.0), name="centre_line_variable_3"
        ),
    }


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """One flight and how it ended."""

    path: str
    """Name of the path, a key of :func:`paper_paths`."""
    programme: Programme
    """What was asked for."""
    rows: FloatArray
    """The frame history, shape (frames, SIGNAL_COUNT)."""
    end_reason: str
    """Why it ended before its time; empty where it was completed."""
    database: str = ""
    """LPV database that was flown, a file; empty: the shipped XV-15."""

    def __getitem__(self, signal: str) -> FloatArray:
        """One signal over the flight, shape (frames,), in the unit of its name.

        Args:
            signal: One of ``rtsim.frame.SIGNAL_NAMES``.
        """
        column: FloatArray = self.rows[:, SIGNAL_NAMES.index(signal)]
        return column

    @property
    def time(self) -> FloatArray:
        """Time of the frames [s], shape (frames,)."""
        return self["time_s"]

    @property
    def completed(self) -> bool:
        """Whether it was flown to its end."""
        return not self.end_reason


class Flyer:
    """Flies paths by one variant; the aircraft is loaded and a pilot designed once."""

    def __init__(self, variant: Variant, *, jobs: int = 1) -> None:
        """Prepare the variant.

        Args:
            variant: Who flies what.
            jobs: Processes for the design of a pilot.
        """
        self.variant = variant
        self._pilot = _designed_pilot(variant, jobs) if variant.pilot is not None else None

    def fly(self, name: str, path: ConversionPath) -> Flight:
        """Fly one path to its end.

        Args:
            name: What the flight is called.
            path: The path.
        """
        programme, variant = path.programme(), self.variant
        air = AirSpecification()
        if variant.turbulence:
            air = AirSpecification(turbulence=Turbulence(wind_at_20_ft=variant.turbulence))
        setup = FlightSetup(programme=programme, air=air).with_options(
            plant=variant.plant,
            outer_loop=variant.outer_loop,
            rate_hz=RATE_HZ,
            seed=variant.seed,
            database=variant.database,
        )
        parts = build_parts(setup)
        if self._pilot is not None:
            parts = dataclasses.replace(parts, tables=parts.tables._replace(pilot=self._pilot))
        simulation = Simulation(setup, parts=parts)
        rows = simulation.run(max(1, math.ceil(programme.duration * RATE_HZ - 1e-6)))
        return Flight(name, programme, rows, simulation.end_reason, variant.database)


def _designed_pilot(variant: Variant, jobs: int) -> PilotTables:
    """Gains of a pilot with other settings, at every grid point."""
    from rtsim.pilot.schedule import design_schedule
    from rtsim.pilot.tables import pack_pilot

    database = load_database(variant.database or None)
    schedule = design_schedule(database, outer_loop=variant.outer_loop, settings=variant.pilot, jobs=jobs)
    return pack_pilot(database, schedule, dt=1 / RATE_HZ)


__all__ = ["BASELINE", "RATE_HZ", "VARIANTS", "Flight", "Flyer", "Variant", "paper_paths"]
