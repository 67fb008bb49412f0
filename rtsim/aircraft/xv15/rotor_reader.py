"""Make the rotor's tables from the sourced data: stations, twist, section aerodynamics with stall."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from rtsim.aircraft.smooth_tables import smooth_curves
from rtsim.aircraft.xv15.tables import RotorTables
from rtsim.arrays import FloatArray
from rtsim.units import FOOT, SLUG_FOOT_SQUARED, deg

SEA_LEVEL_SOUND_SPEED = 340.294
"""Speed of sound of the standard atmosphere at sea level [m/s]."""
SECTION_GRID = np.radians(np.arange(-180.0, 180.5, 1.0))


def _lift_nodes(alpha: list[float], lift: list[float]) -> tuple[list[float], list[float]]:
    """Section lift over the whole circle: data between -6 and 12 deg, a stalled plate (1.1 sin 2 alpha) beyond."""
    plate = [(a, 1.1 * np.sin(2.0 * deg(a))) for a in (-180, -165, -135, -90, -45, -30, -20)]
    plate_after = [(a, 1.1 * np.sin(2.0 * deg(a))) for a in (25, 45, 90, 135, 165, 180)]
    # Negative stall: the last slope carries half as far again as printed, then meets the plate.
    onset = (-10.0, lift[0] + 0.5 * (lift[0] - lift[1]) / (alpha[0] - alpha[1]) * (-10.0 - alpha[0]))
    nodes = [*plate, onset, *zip(alpha, lift, strict=True), (16.0, 0.93 * lift[-1]), *plate_after]
    return [deg(a) for a, _ in nodes], [float(v) for _, v in nodes]


def _drag_nodes(alpha: list[float], drag: list[float]) -> tuple[list[float], list[float]]:
    """Section drag over the whole circle: data between -4 and 8 deg, a plate (2 sin^2 alpha) beyond about 20 deg."""

    def plate(a: float) -> float:
        return float(0.012 + 2.0 * np.sin(deg(a)) ** 2)

    def bridge(a: float, start: float, start_drag: float, end: float) -> float:
        share = (a - start) / (end - start)
        return float(start_drag ** (1.0 - share) * plate(end) ** share)

    before = [(a, plate(a)) for a in (-180, -165, -135, -90, -60, -40, -25, -18)]
    before += [(a, bridge(a, alpha[0], drag[0], -18.0)) for a in (-14, -10, -7)]
    after = [(a, bridge(a, alpha[-1], drag[-1], 20.0)) for a in (11, 14, 17)]
    after += [(a, plate(a)) for a in (20, 25, 40, 60, 90, 135, 165, 180)]
    nodes = [*before, *zip(alpha, drag, strict=True), *after]
    return [deg(a) for a, _ in nodes], [float(v) for _, v in nodes]


def _region_weights(edges: list[float], stations: FloatArray) -> FloatArray:
    """Weights of the four radial regions at each station, linear between the regions' middles."""
    middles = [0.5 * (a + b) for a, b in pairwise(edges)]
    weights = np.zeros((stations.size, len(middles)))
    for column in range(len(middles)):
        unit = np.zeros(len(middles))
        unit[column] = 1.0
        weights[:, column] = np.interp(stations, middles, unit)
    return weights


def read_rotor(data: dict[str, Any], choices: dict[str, Any]) -> RotorTables:
    """Tables of one rotor.

    Args:
        data: The sourced inputs.
        choices: Our choices.
    """
    rotor, own, section = data["rotor"], choices["rotor"], data["rotor"]["c81_reduced"]
    radius = rotor["radius_ft"] * FOOT
    twist_nodes = np.array(rotor["twist_rR"])
    cutout = rotor["root_cutout_rR"]
    edges = np.concatenate([[cutout], twist_nodes[twist_nodes > cutout]])
    edges = np.sort(np.append(edges, own["tip_loss_factor"]))
    stations = 0.5 * (edges[1:] + edges[:-1])
    chord = np.interp(stations, rotor["chord_rR"], rotor["chord_dist_ft"]) * FOOT
    from scipy.interpolate import PchipInterpolator

    twist = PchipInterpolator(twist_nodes, np.radians(rotor["twist_deg"]))
    regions = len(section["region_rR_edges"]) - 1
    weights = _region_weights(section["region_rR_edges"], stations)
    lift_regions, drag_regions = [], []
    for region in range(1, regions + 1):
        lift_regions.append(_lift_nodes(section["alpha_cl_deg"], section[f"cl_R{region}"]))
        drag_regions.append(_drag_nodes(section["alpha_cd_deg"], section[f"cd_R{region}"]))
    lift = smooth_curves([n for n, _ in lift_regions], [v for _, v in lift_regions], SECTION_GRID)
    drag = smooth_curves([n for n, _ in drag_regions], [v for _, v in drag_regions], SECTION_GRID)
    thickness = np.interp(stations, own["thickness_rR"], own["thickness_fraction"])
    full, zero = own["root_drag_full_rR"], own["root_drag_zero_rR"]
    data_tip_speed = own["hover_tip_speed_of_section_data_ft_s"] * FOOT
    reference_mach = stations * data_tip_speed / SEA_LEVEL_SOUND_SPEED
    azimuth = 2.0 * np.pi * np.arange(own["azimuth_stations"]) / own["azimuth_stations"]
    return RotorTables(
        radius=radius,
        blades=float(rotor["n_blades"]),
        stations=stations * radius,
        widths=np.diff(edges) * radius,
        lifting=(stations < own["tip_loss_factor"]).astype(float),
        chord=chord,
        twist=twist(stations) - twist(0.75),
        root_drag=own["root_drag_coefficient"] * np.clip((zero - stations) / (zero - full), 0.0, 1.0),
        drag_divergence=own["korn_factor"] - thickness,
        reference_mach=reference_mach,
        reference_glauert=np.sqrt(1.0 - reference_mach**2),
        section_start=lift.start,
        section_step=lift.step,
        section=np.ascontiguousarray(
            np.stack(
                [
                    weights @ lift.values,
                    weights @ lift.slopes * lift.step,
                    weights @ drag.values,
                    weights @ drag.slopes * drag.step,
                ],
                axis=-1,
            )
        ),
        cos_azimuth=np.cos(azimuth),
        sin_azimuth=np.sin(azimuth),
        precone=deg(rotor["precone_deg"]),
        pitch_flap=rotor["pitch_flap_coupling_dtheta_dbeta"],
        blade_inertia=rotor["I_blade_slugft2"] * SLUG_FOOT_SQUARED,
        coning_frequency_squared=own["coning_frequency_per_rev"] ** 2,
        hub_spring=rotor["hub_spring_Nm_per_rad_per_rotor"],
        induced_factor=own["induced_power_factor"],
        apparent_mass=own["inflow_apparent_mass"],
        gradient_apparent_mass=own["inflow_gradient_apparent_mass"],
        skew_gradient=own["white_blake_gradient"],
        side_by_side=smooth_curves(
            [rotor["side_by_side_mu"]], [rotor["side_by_side_XSS"]], np.arange(0.0, 0.3025, 0.0125)
        ),
    )
