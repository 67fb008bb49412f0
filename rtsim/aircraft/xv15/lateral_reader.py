"""Read the sourced lateral data of the XV-15 and make the kernels' tables (mast angles and imperial units end here)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rtsim.aircraft.smooth_tables import NACELLE_GRID, against_nacelle, smooth_curves, smooth_surface, stack_surfaces
from rtsim.aircraft.table_kernels import Curves, Surfaces
from rtsim.aircraft.xv15.lateral_tables import (
    FinTables,
    HalfTables,
    LateralControlTables,
    LateralMassTables,
    LateralTables,
    SideslipTables,
    WingSideTables,
)
from rtsim.arrays import FloatArray
from rtsim.units import FOOT, INCH, KNOT, SLUG_FOOT_SQUARED, deg

Data = dict[str, Any]

FLAPS = (0, 20, 40, 75)
"""Published flap settings [deg]."""
SIDESLIP_GRID = np.radians(np.arange(0.0, 181.0, 1.0))
PER_DEGREE = 180.0 / math.pi


def _mirrored(nodes: Sequence[float], values: Sequence[float], *, odd: bool) -> tuple[list[float], list[float]]:
    """A table that begins at 0, with its mirror image before it: its slope at 0 is then that of the whole function."""
    sign = -1.0 if odd else 1.0
    return [-a for a in reversed(nodes[1:])] + [*nodes], [sign * v for v in reversed(values[1:])] + [*values]


def _even(tables: Sequence[tuple[Sequence[float], Sequence[float]]], grid: FloatArray) -> Curves:
    """Even functions of an angle printed in degrees, from 0."""
    pairs = [_mirrored([deg(a) for a in nodes], values, odd=False) for nodes, values in tables]
    return smooth_curves([nodes for nodes, _ in pairs], [values for _, values in pairs], grid)


def _joined(*curves: Curves) -> Curves:
    """Curves on one grid together."""
    first = curves[0]
    return Curves(first.start, first.step, np.vstack([c.values for c in curves]), np.vstack([c.slopes for c in curves]))


def _sideslip(data: Data, choices: Data) -> SideslipTables:
    printed, tail = data["fuselage"]["sideslip"], data["htail"]
    beta = printed["beta_deg"]
    grid = SIDESLIP_GRID[:91]
    odd = [
        _mirrored([deg(a) for a in beta], [value * FOOT**power for value in printed[key]], odd=True)
        for key, power in (("Y_over_q_ft2", 2), ("l_over_q_ft3", 3), ("N_over_q_ft3", 3))
    ]
    even = [
        (nodes, [(value - printed[key][0]) * FOOT**power for value in printed[key]])
        for key, nodes, power in (
            ("L_over_q_ft2", beta, 2),
            ("D_over_q_ft2", beta, 2),
            ("M_over_q_ft3", printed["M_beta_deg"], 3),
        )
    ]
    wake = data["rotor_wake_at_htail"]["K_H_beta"]
    rows = [wake[key] for key in ("betam0", "betam15", "betam30", "betam60_90")]
    return SideslipTables(
        fuselage=_joined(smooth_curves([a for a, _ in odd], [v for _, v in odd], grid), _even(even, grid)),
        tail_wake=_even([(wake["beta_abs_deg"], row) for row in rows], np.radians(np.arange(0.0, 41.0, 1.0))),
        tail_lift=tail["CLH_beta_per_deg"] * PER_DEGREE,
        rounding=deg(choices["sideslip_rounding_deg"]),
    )


def _by_flap(nodes: Sequence[float], rows: dict[int, Sequence[float]], scale: float = 1.0) -> Curves:
    """Rows F0 F20 F40 F75 printed against mast angle."""
    return against_nacelle(nodes, [[scale * value for value in rows[flap]] for flap in FLAPS])


def _wing(data: Data, choices: Data) -> WingSideTables:
    wing, geometry = data["wing"], data["geometry"]
    slip, damping, aileron = wing["sideslip"], wing["damping"], wing["aileron"]
    mast = slip["betam_deg"]
    span = geometry["wing_span_ft"] * FOOT
    flapped = {flap: "F0" if flap == 0 else "F20_F40_F75" for flap in FLAPS}
    ends = [0.0, 90.0]

    def between(name: str) -> dict[int, Sequence[float]]:
        """Rows from values printed at mast 0 and 90 deg for the flap settings."""
        pairs = [damping[f"{name}_betam{b}_F0_F20_F40_F75{'_per_deg' if 'alpha' in name else ''}"] for b in (0, 90)]
        return {flap: [row[k] for row in pairs] for k, flap in enumerate(FLAPS)}

    base = aileron["Cl_delta_a_base_per_deg"] * PER_DEGREE
    return WingSideTables(
        span=span,
        aspect_ratio=span**2 / (geometry["wing_area_ft2"] * FOOT**2),
        roll_sideslip=_joined(
            _by_flap(mast, {flap: slip[f"Clbeta_at_CL0_{name}_per_rad"] for flap, name in flapped.items()}),
            _by_flap(mast, {flap: slip[f"Clbeta_per_CL_{name}_per_rad"] for flap, name in flapped.items()}),
        ),
        yaw_sideslip=np.array([slip["Cnbeta_at_CL0_per_rad"], slip["Cnbeta_per_CL2_per_rad"]]),
        roll_roll=damping["Clp_at_CL0_M0_per_rad"],
        lift_slope=_by_flap(ends, between("CLalpha_at_CL0"), PER_DEGREE),
        profile_drag=_by_flap(ends, between("CD0_at_CL0")),
        roll_yaw=np.array([damping["Clr_per_CL_per_rad"], damping["Clr_flap_increment_per_deg_flap"] * PER_DEGREE]),
        yaw_roll=damping["Cnp_per_CL_per_rad"],
        yaw_yaw=np.array([damping["Cnr_per_CL2_per_rad"], damping["Cnr_per_CD0_per_rad"]]),
        sweep=deg(-6.5),  # as in the source's compressibility law
        aileron_roll=_by_flap(aileron["K_l_betam_deg"], {flap: aileron[f"K_l_F{flap}"] for flap in FLAPS}, base),
        aileron_yaw=_joined(
            _by_flap(aileron["K_n_betam_deg"], {f: aileron[f"K_n0_F{f}_per_deg"] for f in FLAPS}, PER_DEGREE),
            _by_flap(aileron["K_n_betam_deg"], {f: aileron[f"K_n_F{f}"] for f in FLAPS}),
        ),
        aileron_lift=np.array(aileron["CL_delta_a_loss_per_deg_F0_F20_F40_F75"]) * PER_DEGREE,
        aileron_fade=np.radians([8.0, 25.0]),  # K_l_alpha_rule
        rounding=deg(choices["aileron_rounding_deg"]),
    )


def _fin(data: Data, choices: Data) -> FinTables:
    printed, position = data["vtail"], data["geometry"]["fin_SL_WL_BL_in"]
    force, drag = printed["CYV_M02"], printed["CDV"]
    rudder = {-20: "dr_m20", -15: "dr_m15", 0: "dr0", 15: "dr_p15", 20: "dr_p20"}
    base = drag["M02"][0]
    slope = force["dr0"][force["beta_V_deg"].index(8.0)] / 8.0
    sidewash = printed["sidewash"]
    angles, sizes = np.radians(np.arange(-12.0, 31.0, 2.0)), np.radians(np.arange(0.0, 57.0, 2.0))
    return FinTables(
        area=choices["fin_area_each_ft2"] * FOOT**2,
        position=np.array(position) * INCH,
        pressure=printed["eta_VS"],
        force=_surface(
            [deg(a) for a in force["beta_V_deg"]],
            [deg(float(a)) for a in rudder],
            np.array([force[key] for key in rudder.values()]).T,
            SIDESLIP_GRID,
            np.radians(np.arange(-20.0, 20.5, 2.5)),
        ),
        drag=_even([(drag["beta_V_deg"], [value - base for value in drag["M02"]])], SIDESLIP_GRID),
        mach_gain=printed["CYV_mach"]["M04"][1] / printed["CYV_mach"]["beta_V_deg"][1] / slope - 1.0,
        sidewash=stack_surfaces(
            [_sidewash(sidewash[f"F{flap}_betam{b}"], angles, sizes) for b in (0, 30, 60, 90) for flap in FLAPS],
            angles,
            sizes,
        ),
        sidewash_nacelle=np.radians([90.0, 60.0, 30.0, 0.0]),
        rotor_sidewash=_rotor_sidewash(printed["rotor_sidewash_K_betaR"], on=choices["rotor_sidewash"]),
        rotor_sidewash_nacelle=np.radians(
            [choices["rotor_sidewash_none_nacelle_deg"], choices["rotor_sidewash_full_nacelle_deg"]]
        ),
        roll_sidewash=printed["dsigma_dphat"],
        least_speed=printed["U_floor_fps"] * FOOT,
    )


def _surface(
    x: Sequence[float], y: Sequence[float], values: FloatArray, x_grid: FloatArray, y_grid: FloatArray
) -> Surfaces:
    return stack_surfaces([smooth_surface(x, y, values, x_grid=x_grid, y_grid=y_grid)], x_grid, y_grid)


def _sidewash(printed: Sequence[Sequence[float]], angles: FloatArray, sizes: FloatArray) -> FloatArray:
    """One table of 1 less the sidewash slope: 1 outside the printed angles of attack and beyond 50 deg of sideslip."""
    sizes_printed = [-8.0, -4.0, 0.0, 4.0, 8.0, 12.0, 16.0, 20.0, 50.0, 56.0]
    rows = [[r[1], r[0], r[0], r[0], *r[1:], r[4], 1.0] for r in printed]
    ones = [[1.0] * len(sizes_printed)]
    return smooth_surface(
        [deg(a) for a in (-10.0, -3.0, 0.0, 7.0, 13.0, 28.0)],
        [deg(b) for b in sizes_printed],
        np.array(ones + rows + ones),
        x_grid=angles,
        y_grid=sizes,
    )


def _rotor_sidewash(printed: Data, *, on: bool) -> Surfaces:
    speeds = [0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 130.0]
    rows = [printed.get(f"V{speed:.0f}kt", [1.0] * len(printed["beta_abs_deg"])) for speed in speeds]
    values = np.array([_mirrored(printed["beta_abs_deg"], row, odd=False)[1] for row in rows])
    nodes = _mirrored([deg(b) for b in printed["beta_abs_deg"]], [0.0] * len(printed["beta_abs_deg"]), odd=False)[0]
    grid_v, grid_b = np.arange(0.0, 132.5, 2.5) * KNOT, np.radians(np.arange(0.0, 31.0, 2.5))
    return _surface([v * KNOT for v in speeds], nodes, values if on else np.ones_like(values), grid_v, grid_b)


def _controls(data: Data, choices: Data) -> LateralControlTables:
    controls = data["controls"]
    stick, pedal = controls["lateral_stick_travel_in"], controls["pedal_travel_in"]
    slow, middle, fast = (
        controls[f"diff_cyclic_deg_per_in_pedal_{name}"] for name in ("0_60_KCAS", "80_KCAS", "100_KCAS_up")
    )
    nacelle = [deg(90.0 - b) for b in reversed(controls["betam_deg"])]
    rows = np.array([[deg(value) * pedal for value in reversed(row)] for row in (slow, slow, middle, fast, fast)])
    speeds = [v * KNOT for v in (0.0, 60.0, 80.0, 100.0, 110.0)]
    return LateralControlTables(
        collective_per_stick=against_nacelle(
            controls["betam_deg"], [[deg(value) * stick for value in controls["diff_collective_deg_per_in_lateral"]]]
        ),
        cyclic_per_pedal=_surface(speeds, nacelle, rows, np.arange(0.0, 112.5, 2.5) * KNOT, NACELLE_GRID),
        aileron_per_stick=deg(controls["aileron_mean_deg_per_in_lateral"]) * stick,
        rudder_per_pedal=deg(controls["rudder_deg_per_in_pedal"]) * pedal,
        actuator_rate=1.0 / choices["difference_actuator_tau_s"],
    )


def _mass(mass: Data) -> LateralMassTables:
    def law(name: str) -> FloatArray:
        slope = mass[f"d{name}_dbetam_slugft2_per_deg"]
        airplane = mass[f"{name}_heli_slugft2"] + 90.0 * slope
        return np.array([airplane, -slope * PER_DEGREE]) * SLUG_FOOT_SQUARED

    return LateralMassTables(roll=law("Ixx"), yaw=law("Izz"), product=law("Ixz"))


def read_lateral(data: Data, inputs: Data, choices: Data) -> LateralTables:
    """Tables of what acts out of the plane of symmetry.

    Args:
        data: ``xv15_lateral.toml`` as printed.
        inputs: ``xv15_inputs.toml`` as printed: the moments of inertia stand there beside the mass.
        choices: Our choices.
    """
    own, geometry = choices["lateral"], data["geometry"]
    interference, area = data["rotor"]["interference"], data["pylon"]["S_PLAT_each_ft2"]
    share = [value * own["sideward_interference"] for value in interference["X_SF"]]
    ratio = _mirrored(interference["X_SF_argument"], share, odd=False)
    return LateralTables(
        half=HalfTables(
            hub=geometry["hub_BL_in"] * INCH,
            wake=geometry["wing_AC_SL_WL_BL_in"][2] * INCH,
            tilt=deg(own["mast_tilt_deg"]),
            rotation=own["rotation"],
            interference=smooth_curves([ratio[0]], [ratio[1]], np.arange(0.0, 0.3225, 0.005)),
            pylon_area=area * FOOT**2,
        ),
        sideslip=_sideslip(data, own),
        wing=_wing(data, own),
        fin=_fin(data, own),
        controls=_controls(data, own),
        mass=_mass(inputs["mass"]),
    )
