"""Make the blade sections' tables: lift and drag over angle of attack and Mach number, with rotational stall delay.

Sources: sections NASA/TP-2004-212262 App. A (``data/rotor_sections.toml``); stall delay Corrigan and Schillings 1994,
Du and Selig 1998 (AIAA 98-0021). A section is printed from -10 to 30 deg; beyond, it becomes a stalled flat plate.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from rtsim.aircraft.profile import XV15_DATA
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.toml_file import shipped_toml

ANGLE_STEP_DEG = 1.0
MACH_STEP = 0.05
ANGLES_DEG = np.arange(-181.0, 181.5, ANGLE_STEP_DEG)
"""Nodes in angle of attack, one more than the circle at both ends [deg]."""
MACHS = np.arange(-MACH_STEP, 0.95 + 0.5 * MACH_STEP, MACH_STEP)
"""Nodes in Mach number, one more than 0 to 0.9 at both ends."""
STALL_DELAYS = ("corrigan_schillings", "du_selig", "none")
_LAST_STALL_DEG = 16.0
"""A section whose printed lift still grows here counts as stalled here [deg]."""
_PLATE_BELOW_DEG, _PLATE_ABOVE_DEG = -20.0, 60.0
"""Beyond, the sections are plates without stall delay; up to the end of the print it acts in full [deg]."""


def section_tables(stations: FloatArray, chord_over_radius: FloatArray, own: dict[str, Any]) -> FloatArray:
    """Lift and drag coefficient at every station.

    Args:
        stations: Radius over rotor radius.
        chord_over_radius: Chord over local radius.
        own: Our choices for the rotor: ``stall_delay`` and ``stall_delay_exponent``.

    Returns:
        Nodes of the splines of ``rotor_kernels``, shape (stations, angles, Mach numbers, 2).

    Raises:
        InputError: There is no such stall delay.
    """
    if own["stall_delay"] not in STALL_DELAYS:
        raise InputError(
            "no such stall delay", key="rotor.stall_delay", value=own["stall_delay"], allowed=", ".join(STALL_DELAYS),
            mend="name one of them",
        )  # fmt: skip
    data = shipped_toml(XV15_DATA, "rotor_sections.toml")
    edges = data["region_rR_edges"]
    printed = [_printed(data, region) for region in range(1, len(edges))]
    weights = _region_weights(edges, stations)
    alpha = np.array(data["alpha_deg"])
    plate_lift = 1.1 * np.sin(2.0 * np.radians(ANGLES_DEG))
    plate_drag = 0.012 + 2.0 * np.sin(np.radians(ANGLES_DEG)) ** 2
    tables = np.empty((stations.size, ANGLES_DEG.size, MACHS.size, 2))
    for i, ratio in enumerate(chord_over_radius):
        lift, drag = (sum(w * p[kind] for w, p in zip(weights[i], printed, strict=True)) for kind in (0, 1))
        for m in range(MACHS.size):
            nodes = _delayed(alpha, lift[:, m], drag[:, m], stations[i], ratio, own)
            tables[i, :, m, 0] = _with_plate(nodes[0], nodes[1], plate_lift)
            tables[i, :, m, 1] = _with_plate(nodes[2], nodes[3], plate_drag)
    tables = _interpolating(tables)
    tables[:, 0], tables[:, -1] = tables[:, -3], tables[:, 2]  # once round the circle
    return np.ascontiguousarray(tables)


def _printed(data: dict[str, Any], region: int) -> tuple[FloatArray, FloatArray]:
    """One region's lift and drag at the printed angles and at MACHS, held beyond the printed Mach numbers."""
    table = data[f"region_{region}"]
    found = []
    for kind in ("cl", "cd"):
        mach, rows = np.array(table[f"mach_{kind}"]), np.array(table[f"{kind}_rows_alpha_cols_mach"])
        if region == 3:  # the deck repeats the stall of M 0.30 at M 0.52 (data file, anomaly)
            mach, rows = (np.delete(values, list(mach).index(0.52), axis=-1) for values in (mach, rows))
        found.append(np.array([np.interp(MACHS, mach, row) for row in rows]))
    return found[0], found[1]


def _region_weights(edges: list[float], stations: FloatArray) -> FloatArray:
    """Weights of the radial regions at each station, linear between the regions' middles."""
    middles = [0.5 * (a + b) for a, b in pairwise(edges)]
    return np.column_stack([np.interp(stations, middles, unit) for unit in np.eye(len(middles))])


def _delayed(
    alpha: FloatArray, lift: FloatArray, drag: FloatArray, station: float, ratio: float, own: dict[str, Any]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Angles and lift, angles and drag of a section whose stall the rotation delays."""
    if own["stall_delay"] == "none":
        return alpha, lift, alpha, drag
    zero, four = (int(np.flatnonzero(alpha == a)[0]) for a in (0.0, 4.0))
    slope = (lift[four] - lift[zero]) / (alpha[four] - alpha[zero])
    rising = slice(0, four + 1)
    zero_lift = float(np.interp(0.0, lift[rising], alpha[rising]))
    if own["stall_delay"] == "du_selig":
        lift_share = du_selig_share(station, ratio, 1.0)
        above = alpha > zero_lift
        return (
            alpha,
            np.where(above, lift + lift_share * np.maximum(slope * (alpha - zero_lift) - lift, 0.0), lift),
            alpha,
            np.where(above, drag - du_selig_share(station, ratio, 0.5) * np.maximum(drag - drag[zero], 0.0), drag),
        )
    delay = (corrigan_schillings_factor(ratio) ** own["stall_delay_exponent"] - 1.0) * (
        stall_angle(alpha, lift) - zero_lift
    )
    # The curve slides up its own slope; below the angle of zero lift it stays, and between them it is that slope.
    slid = alpha > zero_lift
    return (
        np.concatenate([alpha[~slid], [zero_lift], alpha[slid] + delay]),
        np.concatenate([lift[~slid], [0.0], lift[slid] + slope * delay]),
        alpha,
        drag,
    )


def corrigan_schillings_factor(chord_over_radius: float) -> float:
    """K of Corrigan and Schillings: how much the range from zero lift to stall grows, for an exponent of one.

    Args:
        chord_over_radius: Chord over local radius.
    """
    gradient = (0.1517 / chord_over_radius) ** (1.0 / 1.084)
    return float(gradient * chord_over_radius / 0.136)


def du_selig_share(station: float, chord_over_radius: float, exponent: float) -> float:
    """How far Du and Selig move a coefficient towards its unstalled value, for a rotor in hover (Lambda = 1).

    Args:
        station: Radius over rotor radius.
        chord_over_radius: Chord over local radius.
        exponent: 1 for lift, 0.5 for drag.
    """
    power = chord_over_radius ** (exponent / station)
    share = (1.6 * chord_over_radius / 0.1267 * (1.0 - power) / (1.0 + power) - 1.0) / (2.0 * np.pi)
    return float(np.clip(share, 0.0, 1.0))


def stall_angle(alpha: FloatArray, lift: FloatArray) -> float:
    """The angle at which the printed lift first stops growing [deg].

    Args:
        alpha: Printed angles [deg].
        lift: Lift coefficients.
    """
    for i in np.flatnonzero((alpha >= 4.0) & (alpha < _LAST_STALL_DEG)):
        if lift[i + 1] <= lift[i]:
            return float(alpha[i])
    return _LAST_STALL_DEG


def _with_plate(angles: FloatArray, values: FloatArray, plate: FloatArray) -> FloatArray:
    """Values at ANGLES_DEG: what is printed, a flat plate well beyond both ends, and straight lines between."""
    outside = (ANGLES_DEG <= _PLATE_BELOW_DEG) | (ANGLES_DEG >= _PLATE_ABOVE_DEG)
    order = np.argsort(nodes := np.concatenate([ANGLES_DEG[outside], angles]))
    return np.asarray(np.interp(ANGLES_DEG, nodes[order], np.concatenate([plate[outside], values])[order]))


def _interpolating(values: FloatArray) -> FloatArray:
    """Nodes of quadratic splines that pass through the values, to fourth order and without leaving their neighbours."""
    for axis in (1, 2):
        moved = np.moveaxis(values, axis, 0)
        near = np.stack([moved[:-2], moved[1:-1], moved[2:]])
        nodes = moved.copy()
        nodes[1:-1] = np.clip(1.25 * near[1] - 0.125 * (near[0] + near[2]), near.min(axis=0), near.max(axis=0))
        values = np.moveaxis(nodes, 0, axis)
    return values
