"""Make the rotor's tables from the sourced data: stations, chord, twist, sections, hub, inflow."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtsim.aircraft.smooth_tables import smooth_curves
from rtsim.aircraft.xv15.section_reader import ANGLE_STEP_DEG, ANGLES_DEG, MACH_STEP, MACHS, section_tables
from rtsim.aircraft.xv15.tables import RotorTables
from rtsim.units import FOOT, SLUG_FOOT_SQUARED, deg


def read_rotor(data: dict[str, Any], choices: dict[str, Any]) -> RotorTables:
    """Tables of one rotor.

    Args:
        data: The sourced inputs.
        choices: Our choices.
    """
    rotor, own = data["rotor"], choices["rotor"]
    radius = rotor["radius_ft"] * FOOT
    twist_nodes = np.array(rotor["twist_rR"])
    cutout = rotor["root_cutout_rR"]
    edges = np.append(np.linspace(cutout, own["tip_loss_factor"], own["radial_stations"]), 1.0)
    stations = 0.5 * (edges[1:] + edges[:-1])
    chord = np.interp(stations, rotor["chord_rR"], rotor["chord_dist_ft"]) * FOOT
    from scipy.interpolate import PchipInterpolator

    twist = PchipInterpolator(twist_nodes, np.radians(rotor["twist_deg"]))
    full, zero = own["root_drag_full_rR"], own["root_drag_zero_rR"]
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
        section_start=np.radians(ANGLES_DEG[0]),
        section_step=np.radians(ANGLE_STEP_DEG),
        mach_start=MACHS[0],
        mach_step=MACH_STEP,
        section=section_tables(stations, chord / (stations * radius), own),
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
        skew_gradient_onset=own["white_blake_onset_advance_ratio"],
        ground_relief=choices["ground"]["induced_velocity_relief"],
        side_by_side=smooth_curves(
            [rotor["side_by_side_mu"]], [rotor["side_by_side_XSS"]], np.arange(0.0, 0.3025, 0.0125)
        ),
    )
