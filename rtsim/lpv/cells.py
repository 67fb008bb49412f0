"""What is done to a database's cells before they are kept: derivatives rounded, cells without a trim filled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.database import Database

JACOBIAN_BITS: Final = 20
"""Bits kept of the mantissa of derivatives (6 significant digits); trims are kept in full."""


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
