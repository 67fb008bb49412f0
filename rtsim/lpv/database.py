"""The LPV database in memory: trim map, linear models and pilot gains on a grid, read-only and checked.

Leading axes of every array are [layer, airspeed, nacelle]: the layers are trims at different level accelerations.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rtsim.aircraft.profile import AircraftProfile, borrowed_profile
from rtsim.aircraft.variables import Variable, with_roles
from rtsim.errors import InputError
from rtsim.lpv.validation import AXES, check_database

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

GRIDDED: Final = ("x_ref", "u_ref", "y_ref", "xdot_ref", "A", "B", "C", "D", "df_dnacelle", "valid")
"""Arrays with the leading axes [layer, airspeed, nacelle]."""
JACOBIAN_BITS: Final = 20
"""Bits kept of the mantissa of derivatives (6 significant digits); trims are kept in full."""


@dataclass(frozen=True, slots=True)
class PilotArrays:
    """The gains of one pilot design, stored with the database they were designed for."""

    arrays: Mapping[str, FloatArray]
    """Named arrays."""
    attributes: Mapping[str, str | float | int] = field(default_factory=dict)
    """What people and the loader need to know of the design (weights, versions)."""


@dataclass(frozen=True, slots=True, eq=False)  # the same only as itself, so that what is made from it can be kept
class Database:
    """Trim map and linear models of one aircraft in one condition. SI and radians throughout."""

    layer_acceleration: FloatArray
    """Level acceleration of each layer (L,) [m/s^2], ascending; contains 0."""
    airspeed: FloatArray
    """Horizontal airspeed, signed (V,) [m/s], ascending."""
    nacelle: FloatArray
    """Nacelle angle (N,) [rad], ascending; pi/2 helicopter."""
    x_ref: FloatArray
    """Trim state [..., nx]; altitude entry 0."""
    u_ref: FloatArray
    """Trim input [..., nu]; nacelle rate, acceleration and gusts 0."""
    y_ref: FloatArray
    """Trim output [..., ny]."""
    xdot_ref: FloatArray
    """State derivative at the trim [..., nx]: 0 on the level layer, the steady acceleration on the others."""
    A: FloatArray
    """Derivative of the state derivative with the state [..., nx, nx], gravity and kinematics included."""
    B: FloatArray
    """Derivative of the state derivative with the input [..., nx, nu]."""
    C: FloatArray
    """Derivative of the output with the state [..., ny, nx]."""
    D: FloatArray
    """Derivative of the output with the input [..., ny, nu]."""
    df_dnacelle: FloatArray
    """Derivative of the state derivative with the nacelle angle [..., nx]."""
    valid: BoolArray
    """Whether a trim exists here [...]; where not, the cell holds the nearest valid airspeed's models."""
    flap: FloatArray
    """Flap deflection of the flap schedule (V, N) [rad]."""
    rotor_speed: float
    """Rotor speed, held [rad/s]."""
    states: tuple[Variable, ...]
    """The nx states."""
    inputs: tuple[Variable, ...]
    """The nu inputs."""
    outputs: tuple[Variable, ...]
    """The ny outputs."""
    attributes: Mapping[str, str | float | int] = field(default_factory=dict)
    """Title, condition (weight, density), versions, hash of the aircraft data."""
    pilot: Mapping[str, PilotArrays] = field(default_factory=dict)
    """Pilot gains by name of the design."""
    profile: AircraftProfile = field(default_factory=borrowed_profile, repr=False)
    """What flies besides: nacelles, corridor, limits, systems, controls, weights; the XV-15's unless given."""
    _hash: str = field(default="", init=False, repr=False, compare=False)

    def __repr__(self) -> str:
        """Say what it is; the numbers would be pages."""
        title = self.attributes.get("title", "untitled")
        layers, speeds, angles = len(self.layer_acceleration), len(self.airspeed), len(self.nacelle)
        return (
            f"<Database {title!r}: {layers} layers x {speeds} airspeeds x {angles} nacelle angles, "
            f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs>"
        )

    def __post_init__(self) -> None:
        """Make every array read-only, contiguous float64, give known variables their roles, check shapes and axes."""
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                kind = np.bool_ if item.name == "valid" else np.float64
                array: npt.NDArray[Any] = np.ascontiguousarray(value, dtype=kind)
                if array is value and array.flags.writeable:
                    array = array.copy()
                array.setflags(write=False)
                object.__setattr__(self, item.name, array)
        object.__setattr__(self, "states", with_roles("state", self.states))
        object.__setattr__(self, "inputs", with_roles("input", self.inputs))
        object.__setattr__(self, "outputs", with_roles("output", self.outputs))
        check_database(self)

    def freeze(self) -> None:
        """Make every array read-only, as after loading: a copy from another process has lost that."""
        arrays = [getattr(self, item.name) for item in fields(self)]
        arrays += [array for pilot in self.pilot.values() for array in pilot.arrays.values()]
        for array in arrays:
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    def remember_hash(self, content_hash: str) -> None:
        """Take over the content hash of a database with the same numbers.

        Args:
            content_hash: That hash.
        """
        object.__setattr__(self, "_hash", content_hash)

    @property
    def level_layer(self) -> int:
        """Number of the layer of zero acceleration."""
        return int(np.argmin(np.abs(self.layer_acceleration)))

    @property
    def content_hash(self) -> str:
        """SHA-256 over names, units and every number, pilot gains included: the *database hash*."""
        if not self._hash:
            object.__setattr__(self, "_hash", self._compute_hash())
        return self._hash

    @property
    def aircraft_hash(self) -> str:
        """What tells this aircraft from another: the content hash, and the profile where it is not the XV-15's."""
        if self.profile.is_xv15:
            return self.content_hash
        return hashlib.sha256(f"{self.content_hash}{self.profile.content_hash}".encode()).hexdigest()

    def _compute_hash(self) -> str:
        digest = hashlib.sha256()
        for kind in (self.states, self.inputs, self.outputs):
            for variable in kind:
                digest.update(f"{variable.name}[{variable.unit}];".encode())
            digest.update(b"|")
        for name in (*AXES, *GRIDDED, "flap"):
            _update(digest, name, getattr(self, name))
        _update(digest, "rotor_speed", np.array(self.rotor_speed))
        for design in sorted(self.pilot):
            for name in sorted(self.pilot[design].arrays):
                _update(digest, f"pilot/{design}/{name}", self.pilot[design].arrays[name])
        return digest.hexdigest()

    def with_pilot(self, design: str, pilot: PilotArrays) -> Database:
        """Give a copy that carries the gains of one more pilot design.

        Args:
            design: Name of the design; an existing one is replaced.
            pilot: Its arrays and attributes.

        Returns:
            The new database.
        """
        return replace(self, pilot={**self.pilot, design: pilot})


def _update(digest: hashlib._Hash, name: str, array: npt.NDArray[np.generic]) -> None:
    digest.update(f"{name}{array.shape}".encode())
    digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())


def round_mantissa(array: FloatArray, bits: int) -> FloatArray:
    """Round to a number of mantissa bits, so that the rest compresses to nothing.

    Args:
        array: Any finite float64 array.
        bits: Bits of the mantissa to keep (of 52).

    Returns:
        A rounded copy; relative error at most 2**-(bits + 1).
    """
    mantissa, exponent = np.frexp(array)
    scale = float(2 ** (bits + 1))
    return np.asarray(np.ldexp(np.round(mantissa * scale) / scale, exponent), dtype=np.float64)


def quantized(database: Database) -> Database:
    """Round the derivatives to six significant digits; trims stay as they are.

    The database in memory and the file then hold the same bits, and the file is small.

    Args:
        database: A freshly built database.

    Returns:
        The rounded database.
    """
    return replace(
        database,
        A=round_mantissa(database.A, JACOBIAN_BITS),
        B=round_mantissa(database.B, JACOBIAN_BITS),
        C=round_mantissa(database.C, JACOBIAN_BITS),
        D=round_mantissa(database.D, JACOBIAN_BITS),
        df_dnacelle=round_mantissa(database.df_dnacelle, JACOBIAN_BITS),
    )


def fill_invalid(arrays: Mapping[str, npt.NDArray[np.generic]], airspeed: FloatArray, level_layer: int) -> None:
    """Fill cells without a trim from the nearest valid airspeed of the same layer and nacelle angle, in place.

    State, input, output and derivatives come from the same cell; never from another nacelle angle, since that would
    mix trims of different configurations. A layer without any trim at a nacelle angle repeats the level layer.

    Args:
        arrays: Writable gridded arrays by name; ``valid`` says which cells to fill.
        airspeed: The airspeed axis (V,) [m/s].
        level_layer: Number of the layer of level flight.

    Raises:
        InputError: The level layer has no trim at all at some nacelle angle.
    """
    valid = np.asarray(arrays["valid"], dtype=bool)
    holes, sources = [], []
    for layer, v, nacelle in np.argwhere(~valid):
        good = np.flatnonzero(valid[layer, :, nacelle])
        source = int(layer)
        if not good.size:
            source = level_layer
            good = np.flatnonzero(valid[level_layer, :, nacelle])
        if not good.size:
            raise InputError(
                "no trim at any airspeed",
                key=f"valid[{level_layer}, :, {nacelle}]",
                mend="leave this nacelle angle out",
            )
        holes.append((layer, v, nacelle))
        sources.append((source, good[np.argmin(np.abs(airspeed[good] - airspeed[v]))], nacelle))
    if not holes:
        return
    into, out_of = tuple(np.transpose(holes)), tuple(np.transpose(sources))
    for name, array in arrays.items():
        if name != "valid":
            array[into] = array[out_of]
