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
from rtsim.aircraft.variables import SCHEDULING_STATES, Variable, position, with_roles
from rtsim.arrays import BoolArray, FloatArray
from rtsim.errors import InputError

AXES: Final = ("layer_acceleration", "airspeed", "nacelle")
"""The three axes, in the order of the arrays."""
MOST_LAYERS: Final = 8
"""Layers that the kernels' work array has room for."""
GRIDDED: Final = ("x_ref", "u_ref", "y_ref", "xdot_ref", "A", "B", "C", "D", "df_dnacelle", "valid")
"""Arrays with the leading axes [layer, airspeed, nacelle]."""


@dataclass(frozen=True, slots=True)
class StoredArrays:
    """Named arrays that a database carries: the gains of a pilot design made for it, its lateral half."""

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
    """Nacelle angle (N,) [rad], ascending; pi/2 helicopter. Rows below 0 are those of a lower rotor speed at 0."""
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
    rotor_speed: FloatArray
    """Rotor speed that is held in each nacelle row (N,) [rad/s]; below 0 it ascends to that of the others."""
    states: tuple[Variable, ...]
    """The nx states."""
    inputs: tuple[Variable, ...]
    """The nu inputs."""
    outputs: tuple[Variable, ...]
    """The ny outputs."""
    attributes: Mapping[str, str | float | int] = field(default_factory=dict)
    """Title, condition (weight, density), versions, hash of the aircraft data."""
    pilot: Mapping[str, StoredArrays] = field(default_factory=dict)
    """Pilot gains by name of the design."""
    lateral: StoredArrays | None = None
    """The motion out of the plane of symmetry (``rtsim.lpv.lateral.LateralData``); None: it stays in that plane."""
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
        _check(self)

    def freeze(self) -> None:
        """Make every array read-only, as after loading: a copy from another process has lost that."""
        arrays = [getattr(self, item.name) for item in fields(self)]
        groups = [*self.pilot.values(), *([] if self.lateral is None else [self.lateral])]
        arrays += [array for group in groups for array in group.arrays.values()]
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
    def governed_speed(self) -> float:
        """Rotor speed that is held off the downstop [rad/s]."""
        return float(self.rotor_speed[-1])

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
        for name in (*AXES, *GRIDDED, "flap", "rotor_speed"):
            _update(digest, name, getattr(self, name))
        for design in sorted(self.pilot):
            for name in sorted(self.pilot[design].arrays):
                _update(digest, f"pilot/{design}/{name}", self.pilot[design].arrays[name])
        if self.lateral is not None:
            for name in sorted(self.lateral.arrays):
                _update(digest, f"lateral/{name}", self.lateral.arrays[name])
        return digest.hexdigest()

    def with_pilot(self, design: str, pilot: StoredArrays) -> Database:
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


def _expected_shapes(database: Database) -> dict[str, tuple[int, ...]]:
    """Shapes that the arrays must have, from the axes and the lists of variables."""
    grid = (database.layer_acceleration.size, database.airspeed.size, database.nacelle.size)
    nx, nu, ny = len(database.states), len(database.inputs), len(database.outputs)
    tails: dict[str, tuple[int, ...]] = {
        "x_ref": (nx,), "u_ref": (nu,), "y_ref": (ny,), "xdot_ref": (nx,), "df_dnacelle": (nx,), "valid": (),
        "A": (nx, nx), "B": (nx, nu), "C": (ny, nx), "D": (ny, nu),
    }  # fmt: skip
    return {name: grid + tail for name, tail in tails.items()} | {"flap": grid[1:], "rotor_speed": grid[2:]}


def _check(database: Database) -> None:
    """Refuse a database that the kernels could not fly, naming the array and what is wrong with it."""
    _check_variables(database)
    for name in AXES:
        _check_axis(name, getattr(database, name), shortest=1 if name == "layer_acceleration" else 2)
    if np.min(np.abs(database.layer_acceleration)) > 1e-9:
        raise InputError(
            "there is no layer of level flight",
            key="layer_acceleration",
            value=database.layer_acceleration.tolist(),
            mend="add the layer of zero acceleration",
        )
    if database.layer_acceleration.size > MOST_LAYERS:
        raise InputError("too many layers", key="layer_acceleration",
                         value=database.layer_acceleration.size, allowed=f"at most {MOST_LAYERS}")  # fmt: skip
    for name, shape in _expected_shapes(database).items():
        array = getattr(database, name)
        if array.shape != shape:
            raise InputError("wrong shape", key=name, value=array.shape, allowed=f"{shape}")
        if array.dtype != np.bool_ and not np.all(np.isfinite(array)):
            where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
            raise InputError(
                "not a finite number",
                key=f"{name}{list(where)}",
                value=float(array[where]),
                mend="mark the cell invalid and fill it from the nearest airspeed that has a trim",
            )
    slow = database.nacelle < 0.0
    if np.any(database.rotor_speed[~slow] != database.governed_speed) or np.any(
        np.diff(database.rotor_speed[slow]) < 0.0
    ):
        raise InputError(
            "is not one speed off the downstop, to which the rows below nacelle 0 ascend",
            key="rotor_speed",
            value=database.rotor_speed.tolist(),
            mend="give the rotor speed that is held in each nacelle row",
        )
    if not database.valid[database.level_layer].any():
        raise InputError("no cell of the level layer is valid", key="valid")


def _check_variables(database: Database) -> None:
    for kind, variables in (("states", database.states), ("inputs", database.inputs), ("outputs", database.outputs)):
        names = [variable.name for variable in variables]
        for name in names:
            if names.count(name) > 1:
                raise InputError("the same name twice", key=kind, value=name, mend="rename one of them")
    for name in SCHEDULING_STATES:
        if position(database.states, name) < 0:
            raise InputError(
                f"the state '{name}' is missing, from which airspeed and angle of attack are computed",
                key="states",
                value=[variable.name for variable in database.states],
                mend=f"name the state that means '{name}' so",
            )


def _check_axis(name: str, axis: FloatArray, *, shortest: int) -> None:
    if axis.ndim != 1 or axis.size < shortest:
        raise InputError("not an axis", key=name, value=axis.shape, allowed=f"{shortest} or more values")
    if not np.all(np.isfinite(axis)):
        raise InputError("not a finite number on the axis", key=name)
    if np.any(np.diff(axis) <= 0.0):
        first = int(np.argmax(np.diff(axis) <= 0.0)) + 1
        raise InputError("the axis does not ascend", key=f"{name}[{first}]", value=float(axis[first]),
                         mend="sort the axis and the arrays with it")  # fmt: skip
