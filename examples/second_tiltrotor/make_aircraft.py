"""Makes a second, made-up tiltrotor: the XV-15 in two thirds of its size, with a profile and pilots of its own.

Two aircraft of one shape in one gravity are *Froude-similar*: with lengths times s, times go with the square root of s,
masses and forces with s^3, and angles do not change. Every number of an LPV database then scales by the units of its
variables, which are data of the database; nothing here knows a variable by name. (Mach and Reynolds numbers do not
scale: a real aircraft of this size would differ.)

    python examples/second_tiltrotor/make_aircraft.py OUT

writes OUT/two_thirds.nc, with pilots designed for it by the weights of its profile, and OUT/two_thirds.profile.toml
beside it. Fly it with: rtsim fly OUT/conversion.toml
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rtsim.aircraft.profile import OWN_SUFFIX, read_profile
from rtsim.aircraft.variables import Variable
from rtsim.arrays import FloatArray
from rtsim.choices import OUTER_LOOPS, OuterLoop
from rtsim.lpv.cells import fill_invalid
from rtsim.lpv.database import GRIDDED, Database
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.pilot.schedule import design_schedule
from rtsim.units import kt

NAME = "two_thirds"
HERE = Path(__file__).parent
SIZE = 0.64
"""Length of the made-up aircraft over that of the XV-15; its root, 0.8, scales times and speeds."""
POWERS = {
    "": 0.0, "rad": 0.0, "m": 1.0, "m/s": 0.5, "m/s^2": 0.0, "rad/s": -0.5, "rad/s^2": -1.0,
    "kg": 3.0, "N": 3.0, "N m": 4.0, "W": 3.5,
}  # fmt: skip
"""Power of the length scale with which a unit goes."""
AIRSPEEDS_KT = (-20, -10, 0, 10, 20, 30, 40, 50, 60, 74, 88, 102, 116, 130, 140, 150, 160, 170, 180, 200, 230, 260)
"""Airspeeds of the XV-15's grid that are kept."""
NACELLES_DEG = (0.0, 0.5, 15.0, 30.0, 40.0, 50.0, 60.0, 67.5, 75.0, 80.0, 85.0, 90.0)
"""Nacelle angles that are kept."""


def scaled(database: Database, size: float) -> Database:
    """A Froude-similar aircraft, without pilots.

    Args:
        database: The aircraft.
        size: Its length over that of the given one.
    """
    time = np.sqrt(size)

    def factors(variables: Sequence[Variable]) -> FloatArray:
        return np.array([size ** POWERS[variable.unit] for variable in variables])

    x, u, y = factors(database.states), factors(database.inputs), factors(database.outputs)
    mass = float(database.attributes["mass_kg"])
    return replace(
        database,
        airspeed=database.airspeed * size ** POWERS["m/s"],
        rotor_speed=database.rotor_speed * size ** POWERS["rad/s"],
        x_ref=database.x_ref * x,
        u_ref=database.u_ref * u,
        y_ref=database.y_ref * y,
        xdot_ref=database.xdot_ref * (x / time),
        A=database.A * ((x / time)[:, None] / x),
        B=database.B * ((x / time)[:, None] / u),
        C=database.C * (y[:, None] / x),
        D=database.D * (y[:, None] / u),
        df_dnacelle=database.df_dnacelle * (x / time),
        attributes={"title": f"made-up tiltrotor, {size:g} x XV-15", "mass_kg": mass * size ** POWERS["kg"]},
        pilot={},
        lateral=None,
    )


def coarse(database: Database) -> Database:
    """The same aircraft on fewer grid points.

    Args:
        database: The XV-15.
    """
    v = [int(np.argmin(np.abs(database.airspeed - kt(speed)))) for speed in AIRSPEEDS_KT]
    n = [int(np.argmin(np.abs(database.nacelle - np.radians(angle)))) for angle in NACELLES_DEG]
    arrays = {name: getattr(database, name)[:, v][:, :, n] for name in GRIDDED}
    fill_invalid(arrays, database.airspeed[v], database.level_layer)
    return replace(
        database,
        airspeed=database.airspeed[v],
        nacelle=database.nacelle[n],
        rotor_speed=database.rotor_speed[n],
        flap=database.flap[np.ix_(v, n)],
        pilot={},
        lateral=None,
        **arrays,
    )


def make(folder: Path, *, jobs: int = 1, outer_loops: Sequence[OuterLoop] = OUTER_LOOPS) -> Path:
    """Write the aircraft: database with pilots, profile, scenario.

    Args:
        folder: Where to; made if need be.
        jobs: Processes that design the pilots.
        outer_loops: Which pilots.

    Returns:
        The database file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{NAME}.nc"
    for file in (f"{NAME}{OWN_SUFFIX}", "conversion.toml", "wrong_nacelle_command.toml", "search.toml"):
        if folder.resolve() != HERE.resolve():
            shutil.copy(HERE / file, folder / file)
    database = replace(scaled(coarse(load_database()), SIZE), profile=read_profile(folder / f"{NAME}{OWN_SUFFIX}"))
    for outer_loop in outer_loops:
        pilot = design_schedule(database, outer_loop=outer_loop, jobs=jobs)
        database = database.with_pilot(outer_loop, pilot.to_arrays())
    save_database(database, target)
    return target


if __name__ == "__main__":
    print(make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE, jobs=2))
