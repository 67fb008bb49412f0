"""The motion out of the plane of symmetry as a database holds it.

In a mirror every lateral variable changes its sign: about symmetric flight the linear model falls into a symmetric and
a lateral block that do not meet. What joins them is curved: a turn loads the rotors and the wing, and sideslip changes
the symmetric trim. So there are, at each grid point, trims and both blocks at load factors above 1 (straight flight
that carries more than its weight: the air loads of a turn without its rates), and trims with sideward velocity, which
move the references alone.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from rtsim.aircraft.variables import LATERAL_INPUTS, LATERAL_OUTPUTS, LATERAL_STATES
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.kernels.compiled import interpreted
from rtsim.kernels.grid_kernels import cell
from rtsim.lpv.cells import JACOBIAN_BITS, round_mantissa
from rtsim.lpv.database import Database, StoredArrays

REFERENCE_BITS = 36
"""Bits kept of the mantissa of the references (11 significant digits)."""
LATERAL_AXES = {"load_factor": 1.0, "lateral_velocity": 0.0}
"""The axes of the arrays, with what their values are above."""
_cell = interpreted(cell)
_DERIVATIVES = ("loaded_A", "loaded_B", "loaded_C", "loaded_D", "A", "B", "C", "D")


@dataclass(frozen=True, slots=True, eq=False)
class LateralData:
    """Everything that a database says of turns, sideslip and sideward flight. SI and radians.

    Leading axes after the first are [airspeed, nacelle]. Where there is no trim, the array repeats the one before it on
    the first axis, so that what it would change is not changed any further.
    """

    load_factor: FloatArray
    """Load factors (K,) of the loaded trims, ascending from above 1."""
    loaded_x_ref: FloatArray
    """Symmetric states of the loaded trims (K, V, N, nx)."""
    loaded_u_ref: FloatArray
    """Their inputs (K, V, N, nu)."""
    loaded_y_ref: FloatArray
    """Their outputs (K, V, N, ny)."""
    loaded_xdot_ref: FloatArray
    """State derivative there, with the true gravity (K, V, N, nx)."""
    loaded_A: FloatArray  # noqa: N815 - the field's names
    """Derivative of the state derivative with the symmetric states (K, V, N, nx, nx)."""
    loaded_B: FloatArray  # noqa: N815 - the field's names
    """The same with the inputs (K, V, N, nx, nu)."""
    loaded_C: FloatArray  # noqa: N815 - the field's names
    """Derivative of the outputs with the states (K, V, N, ny, nx)."""
    loaded_D: FloatArray  # noqa: N815 - the field's names
    """The same with the inputs (K, V, N, ny, nu)."""
    loaded_valid: FloatArray
    """1 where the trim exists (K, V, N)."""
    A: FloatArray
    """Lateral derivatives (K + 1, V, N, 18, 18): first those of level flight, then those of the loaded trims."""
    B: FloatArray
    """With the lateral inputs (K + 1, V, N, 18, 8)."""
    C: FloatArray
    """Of the lateral outputs with the lateral states (K + 1, V, N, 3, 18)."""
    D: FloatArray
    """With the lateral inputs (K + 1, V, N, 3, 8)."""
    lateral_velocity: FloatArray
    """Velocities along body y (M,) [m/s] of the trims in sideslip, ascending from above 0; to the left mirrored."""
    slip_x_ref: FloatArray
    """States of these, symmetric then lateral ones (M, V, N, nx + 18)."""
    slip_u_ref: FloatArray
    """Inputs, symmetric then lateral ones (M, V, N, nu + 8)."""
    slip_y_ref: FloatArray
    """Outputs, symmetric then lateral ones (M, V, N, ny + 3)."""
    slip_valid: FloatArray
    """1 where the trim exists (M, V, N)."""
    inertia: FloatArray
    """Moments of inertia Ixx, Iyy, Izz and the product Ixz (N, 4) [kg m^2]."""

    def stored(self) -> StoredArrays:
        """The arrays as a database stores them, derivatives rounded as its others are."""
        arrays = {item.name: np.asarray(getattr(self, item.name), dtype=np.float64) for item in fields(self)}
        for name, array in arrays.items():
            arrays[name] = round_mantissa(array, JACOBIAN_BITS if name in _DERIVATIVES else REFERENCE_BITS)
            arrays[name].setflags(write=False)
        names = {
            "states": " ".join(variable.name for variable in LATERAL_STATES),
            "inputs": " ".join(variable.name for variable in LATERAL_INPUTS),
            "outputs": " ".join(variable.name for variable in LATERAL_OUTPUTS),
        }
        return StoredArrays(arrays, names)

    @staticmethod
    def of(database: Database) -> LateralData:
        """What a database holds.

        Args:
            database: A database with a lateral half.

        Raises:
            InputError: An array is missing or has another shape.
        """
        assert database.lateral is not None
        arrays = database.lateral.arrays
        missing = [item.name for item in fields(LateralData) if item.name not in arrays]
        if missing:
            raise InputError("the array is missing", key=f"lateral/{missing[0]}", mend="build the database anew")
        data = LateralData(**{item.name: np.atleast_1d(arrays[item.name]) for item in fields(LateralData)})
        for name, shape in _shapes(database, data).items():
            if getattr(data, name).shape != shape:
                raise InputError(
                    "wrong shape", key=f"lateral/{name}", value=getattr(data, name).shape, allowed=f"{shape}"
                )
        for name, low in LATERAL_AXES.items():
            axis = getattr(data, name)
            if axis[0] <= low or np.any(np.diff(axis) <= 0.0):
                raise InputError(
                    "the axis does not ascend", key=f"lateral/{name}", value=axis.tolist(), allowed=f"above {low:g}"
                )
        return data


def slip_trim(
    database: Database, *, airspeed: float, nacelle: float, lateral: float
) -> tuple[FloatArray, FloatArray, bool]:
    """What sideward velocity changes in the level trim, between the trims in sideslip: linear on every axis.

    Args:
        database: A database with a lateral half.
        airspeed: Airspeed ahead [m/s].
        nacelle: Nacelle angle [rad].
        lateral: Velocity along body y, right positive [m/s].

    Returns:
        Changes of the states and of the inputs, symmetric then lateral ones, and whether such trims exist there.
    """
    data, level = LateralData.of(database), database.level_layer
    (i, s), (j, t) = _cell(database.airspeed, airspeed), _cell(database.nacelle, nacelle)
    corners = (((0, 0), (1 - s) * (1 - t)), ((1, 0), s * (1 - t)), ((0, 1), (1 - s) * t), ((1, 1), s * t))
    m, share = _cell(np.concatenate([[0.0], data.lateral_velocity]), abs(lateral))
    exists = bool(abs(lateral) <= data.lateral_velocity[-1])
    x, u = np.zeros(data.slip_x_ref.shape[-1]), np.zeros(data.slip_u_ref.shape[-1])
    for (di, dj), weight in corners:
        at = i + di, j + dj
        for node, part in ((m - 1, (1.0 - share) * weight), (m, share * weight)):
            if node < 0 or part == 0.0:  # the level trim, from which the changes are counted
                continue
            exists &= bool(data.slip_valid[node, *at])
            x += part * data.slip_x_ref[node, *at]
            u += part * data.slip_u_ref[node, *at]
            x[: database.x_ref.shape[-1]] -= part * database.x_ref[level, *at]
            u[: database.u_ref.shape[-1]] -= part * database.u_ref[level, *at]
    if lateral < 0.0:  # its mirror image
        x[database.x_ref.shape[-1] :] *= -1.0
        u[database.u_ref.shape[-1] :] *= -1.0
    return x, u, exists


def _shapes(database: Database, data: LateralData) -> dict[str, tuple[int, ...]]:
    loads, slips = data.load_factor.size, data.lateral_velocity.size
    grid = (database.airspeed.size, database.nacelle.size)
    nx, nu, ny = len(database.states), len(database.inputs), len(database.outputs)
    lx, lu, ly = len(LATERAL_STATES), len(LATERAL_INPUTS), len(LATERAL_OUTPUTS)
    loaded: dict[str, tuple[int, ...]] = {
        "x_ref": (nx,), "u_ref": (nu,), "y_ref": (ny,), "xdot_ref": (nx,), "A": (nx, nx), "B": (nx, nu),
        "C": (ny, nx), "D": (ny, nu), "valid": (),
    }  # fmt: skip
    lateral = {"A": (lx, lx), "B": (lx, lu), "C": (ly, lx), "D": (ly, lu)}
    slip: dict[str, tuple[int, ...]] = {
        "x_ref": (nx + lx,), "u_ref": (nu + lu,), "y_ref": (ny + ly,), "valid": (),
    }  # fmt: skip
    return (
        {f"loaded_{name}": (loads, *grid, *tail) for name, tail in loaded.items()}
        | {name: (loads + 1, *grid, *tail) for name, tail in lateral.items()}
        | {f"slip_{name}": (slips, *grid, *tail) for name, tail in slip.items()}
        | {"inertia": (grid[1], 4)}
    )
