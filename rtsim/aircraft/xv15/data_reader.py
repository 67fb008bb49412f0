"""Read the sourced XV-15 data and make the kernels' tables: the only module that knows the mast angle.

The data files print imperial units and the mast angle (0 helicopter, 90 airplane); everything that
leaves here is SI and uses the nacelle angle (90 helicopter, 0 airplane).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rtsim.aircraft.atmosphere import standard_atmosphere
from rtsim.aircraft.profile import XV15_DATA
from rtsim.aircraft.smooth_tables import against_nacelle, smooth_curves, smooth_surface, stack_surfaces
from rtsim.aircraft.xv15.lateral_reader import read_lateral
from rtsim.aircraft.xv15.rotor_reader import read_rotor
from rtsim.aircraft.xv15.tables import (
    AircraftTables,
    BodyTables,
    Configuration,
    ControlTables,
    MassTables,
    TailTables,
    WingTables,
)
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.toml_file import shipped_toml
from rtsim.units import FOOT, HORSEPOWER, INCH, KNOT, POUND, POUND_FORCE, SLUG, SLUG_FOOT_SQUARED, deg, rpm

Data = dict[str, Any]

ALPHA_GRID = np.radians(np.arange(-90.0, 90.5, 0.5))


def read_data() -> tuple[Data, Data]:
    """The sourced inputs and our choices, as printed."""
    return shipped_toml(XV15_DATA, "xv15_inputs.toml"), shipped_toml(XV15_DATA, "model_choices.toml")


def read_lateral_data() -> Data:
    """The sourced lateral inputs, as printed."""
    return shipped_toml(XV15_DATA, "xv15_lateral.toml")


def _extended(
    nodes: Sequence[float], values: Sequence[float], ends: dict[float, float]
) -> tuple[list[float], list[float]]:
    """Add end points where a table stops short of +-90 deg; NaN entries of the print are dropped."""
    table = {a: v for a, v in zip(nodes, values, strict=True) if not np.isnan(v)}
    for alpha, value in ends.items():
        if alpha < min(table) or alpha > max(table):
            table[alpha] = value
    ordered = sorted(table)
    return [deg(a) for a in ordered], [table[a] for a in ordered]


def _wing(data: Data, choices: Data) -> WingTables:
    wing = data["wing"]
    lift_rows = [("F0_alpha_deg", "CL_F0_b90_Mle0p2"), *[("flapped_alpha_deg", f"CL_F{f}_b90") for f in (20, 40, 75)]]
    lift_rows += [("F0_alpha_deg", "CL_F0_b0"), *[("flapped_alpha_deg", f"CL_F{f}_b0") for f in (20, 40, 75)]]
    alphas, lifts = [], []
    for nodes_key, key in lift_rows:
        # Beyond the print a stalled surface: lift fades to nothing broadside on.
        ends = {-90.0: 0.0, -60.0: 0.75 * wing[key][0] if nodes_key == "F0_alpha_deg" else 0.0}
        ends |= {60.0: 0.85 * wing[key][-1], 90.0: 0.0}
        a, v = _extended(wing[nodes_key], wing[key], ends)
        alphas.append(a)
        lifts.append(v)
    lift = smooth_curves(alphas, lifts, ALPHA_GRID)
    drag_rows = [
        (wing["CD_F0_alpha_deg"], wing["CD_F0_b90_Mle0p2"]),
        (wing["CD_F20_b90_alpha_deg"], wing["CD_F20_b90"]),
        (wing["CD_flapped_alpha_deg"], wing["CD_F40_b90"]),
        (wing["CD_flapped_alpha_deg"], wing["CD_F75_b90"]),
        (
            [*wing["CD_F0_b0_ext_alpha_deg"], *wing["CD_F0_alpha_deg"]],
            [*wing["CD_F0_b0_ext"], *wing["CD_F0_b0"]],
        ),
        *[(wing["CD_flapped_alpha_deg"], wing[f"CD_F{f}_b0"]) for f in (20, 40, 75)],
    ]
    alphas, drags = [], []
    for nodes, values in drag_rows:
        a, v = _extended(nodes, values, {-90.0: 1.18, -60.0: 0.9, 60.0: 1.1, 90.0: 1.3})
        alphas.append(a)
        drags.append(v)
    moments = np.array(wing["Cm_rows_betam_cols_flap"]).T.tolist()
    interference = wing["interference"]
    gain = interference["K_XRW"]
    x0, x1, x2 = interference["X_RW_poly_in_betam_deg"]
    geometry = data["geometry"]
    mast = [*range(0, 31, 2), 45, 60, 90]
    share = [
        np.sin(1.386 * (np.pi / 2 - deg(b))) + np.cos(3.114 * (np.pi / 2 - deg(b))) if b <= 30 else 0.0 for b in mast
    ]
    immersed = 2.0 * interference["immersed_wing_Smax_ft2_per_half"] * FOOT**2
    ac = geometry["wing_AC_SL_WL_BL_in"]
    return WingTables(
        area=wing["S_ref_ft2"] * FOOT**2,
        chord=wing["c_ref_ft"] * FOOT,
        lift=lift,
        drag=smooth_curves(alphas, drags, ALPHA_GRID),
        moment=against_nacelle(wing["Cm_betam_deg"], moments),
        flap_nodes=np.radians(data["controls"]["flap_settings_deg"]),
        # The law is printed in degrees with a polynomial in degrees; 57.3 turns it to degrees, we stay in radians.
        upwash=gain * np.array([x0, x1 * 180.0 / np.pi, x2 * (180.0 / np.pi) ** 2]),
        mach_gain=choices["wing"]["mach_lift_slope_gain"],
        immersed_area=against_nacelle(mast, [[immersed * max(s, 0.0) for s in share]]),
        immersed_fade_speed=choices["wing"]["immersed_fade_speed_kt"] * KNOT,
        immersed_velocity_factor=interference["induced_velocity_factor_at_wing"],
        position=np.array([ac[0], ac[1]]) * INCH,
        immersed_position=np.array([choices["wing"]["immersed_force_SL_in"], ac[1]]) * INCH,
    )


def _body(data: Data, choices: Data) -> BodyTables:
    fuselage, interference = data["fuselage"], data["wing"]["interference"]
    alpha = [deg(a) for a in fuselage["alpha_deg"]]
    extra = choices["drag"]["fuselage_extra_drag_ft2"]
    rows = [
        [v * FOOT**2 for v in fuselage["L_over_q_ft2"]],
        [(v + extra) * FOOT**2 for v in fuselage["D_over_q_ft2"]],
        [v * FOOT**3 for v in fuselage["M_over_q_ft3"]],
    ]
    return BodyTables(
        fuselage=smooth_curves([alpha] * 3, rows, ALPHA_GRID),
        position=np.array(data["geometry"]["fuselage_ref_SL_WL_in"]) * INCH,
        pylon_area=against_nacelle(
            interference["pylon_interf_betam_deg"], [[v * FOOT**2 for v in interference["pylon_interf_D_ft2"]]]
        ),
        pylon_incidence_factor=smooth_curves(
            [[deg(a) for a in interference["K_PLAT_mast_incidence_deg"]]],
            [interference["K_PLAT"] if choices["drag"]["pylon_k_plat"] else [1.0] * len(interference["K_PLAT"])],
            np.radians(np.arange(0.0, 90.5, 1.0)),
        ),
        spinner_area=2.0 * 1.0 * FOOT**2,
        spinner_incidence_area=2.0 * 5.5 * FOOT**2,
        fin_area=choices["drag"]["vtail_drag_ft2"] * FOOT**2,
        **_jet(data["jet_thrust"], on=choices["drag"]["jet_thrust"]),
    )


def _jet(printed: Data, *, on: bool) -> dict[str, float]:
    """The plane through the printed jet thrusts over power and airspeed (least squares)."""
    power = np.array(printed["rotor_power_shp"]) * HORSEPOWER
    airspeed = np.array(printed["airspeed_kt"]) * KNOT
    terms = np.column_stack([np.ones_like(power), power, -airspeed])
    found = np.linalg.lstsq(terms, np.array(printed["up_lb"]) * POUND_FORCE, rcond=None)[0] * on
    return dict(zip(("jet_static", "jet_per_power", "jet_ram"), found.tolist(), strict=True))


def _tail(data: Data, choices: Data) -> TailTables:
    tail, downwash, wake = data["htail"], data["downwash"], data["rotor_wake_at_tail"]
    elevator_grid = np.radians(np.arange(-20.0, 20.1, 2.5))
    lift = smooth_surface(
        [deg(a) for a in tail["CL_alpha_deg"]],
        [deg(d) for d in tail["de_deg"]],
        np.array(tail["CL_rows_alpha_cols_de"]),
        x_grid=ALPHA_GRID,
        y_grid=elevator_grid,
    )
    mast = (0, 15, 30, 60, 90)
    rows = [[deg(v) for v in downwash[f"eps_b{b}_F{f}"]] for b in mast for f in (0, 20, 40)]
    downwash_alpha = [deg(a) for a in downwash["alpha_deg"]]
    speed_grid = np.arange(0.0, 142.5, 2.5) * KNOT
    alpha_grid = np.radians(np.arange(-45.0, 45.5, 1.0))
    eta_alpha = [-40.0, *tail["eta_alpha_deg"], 30.0]
    speeds = [v * KNOT for v in tail["eta_V_kt"]]
    ones = [[1.0] * len(speeds)]

    def eta(rows_: list[list[float]]) -> FloatArray:
        return smooth_surface(
            [deg(a) for a in eta_alpha], speeds, np.array(ones + rows_ + ones), x_grid=alpha_grid, y_grid=speed_grid
        )

    flat = [[1.0] * len(speeds) for _ in tail["eta_alpha_deg"]]
    sixty = [[1.05 if -12.0 <= a <= 16.0 else 0.8 if a == 20.0 else 1.0] * len(speeds) for a in tail["eta_alpha_deg"]]
    printed = [tail[f"eta_b{b}_rows_alpha_cols_V"] for b in (0, 15)]
    ratio = [eta(rows_) for rows_ in (*printed, flat, sixty, flat)]
    wake_speeds = [v * KNOT for v in wake["V_kt"]]
    wake_alpha = [deg(a) for a in [-30.0, *wake["alpha_deg"], 20.0]]
    zeros = [[0.0] * len(wake_speeds)]
    wakes = [
        smooth_surface(
            wake_alpha,
            wake_speeds,
            np.array(zeros + wake[f"WiH_over_Wi_b{b}_rows_alpha_cols_V"] + zeros),
            x_grid=alpha_grid,
            y_grid=speed_grid,
        )
        for b in (0, 15, 30)
    ]
    return TailTables(
        area=data["geometry"]["htail_S_ft2"] * FOOT**2,
        position=np.array(data["geometry"]["htail_SL_WL_in"]) * INCH,
        pressure_factor=tail["K_q"],
        lift=stack_surfaces([lift], ALPHA_GRID, elevator_grid),
        drag=smooth_curves([[deg(a) for a in tail["CD_alpha_deg"]]], [tail["CD"]], ALPHA_GRID),
        downwash=smooth_curves([downwash_alpha] * len(rows), rows, ALPHA_GRID),
        downwash_nacelle=np.radians([90.0 - b for b in mast]),
        pressure_ratio=stack_surfaces(ratio, alpha_grid, speed_grid),
        rotor_wake=stack_surfaces([table * choices["tail"]["rotor_wake"] for table in wakes], alpha_grid, speed_grid),
        wake_nacelle=np.radians([90.0, 75.0, 60.0, 30.0]),
    )


def _controls(data: Data, choices: Data) -> ControlTables:
    controls, own, lag = data["controls"], choices["controls"], data["assumed_dynamics"]
    half_travel = controls["stick_neutral_in"]
    lever = against_nacelle(
        own["lever_betam_deg"],
        [[deg(v) for v in own["theta75_low_deg"]], [deg(v) for v in own["theta75_high_deg"]]],
    )
    return ControlTables(
        cyclic_per_stick=against_nacelle(
            controls["betam_deg"], [[deg(v) * half_travel for v in controls["cyclic_deg_per_in"]]]
        ),
        cyclic_limit=deg(controls["cyclic_limit_deg"]),
        elevator_per_stick=deg(controls["elevator_deg_per_in"]) * half_travel,
        elevator_limit=deg(data["geometry"]["elevator_limits_deg"][1]),
        collective_range=lever,
        actuator_rate=1.0
        / np.array(
            [
                lag["collective_governor_actuator_tau_s"],
                lag["swashplate_actuator_tau_s"],
                lag["elevator_actuator_tau_s"],
            ]
        ),
        default_flap=deg(own["default_flap_deg"]),
        flap_retraction=np.array([own["flap_retraction_start_kt"], own["flap_retraction_end_kt"]]) * KNOT,
        downstop_nacelle=deg(own["downstop_nacelle_deg"]),
    )


def _mass(data: Data, choices: Data) -> MassTables:
    mass, centre, nacelle = data["mass"], data["cg"], choices["nacelle"]
    slope = mass["dIyy_dbetam_slugft2_per_deg"]
    tip_mass = 2.0 * nacelle["tip_mass_lb_per_side"] * POUND
    return MassTables(
        pitch_inertia_airplane=(mass["Iyy_heli_slugft2"] + 90.0 * slope) * SLUG_FOOT_SQUARED,
        pitch_inertia_slope=-slope * SLUG_FOOT_SQUARED * 180.0 / np.pi,
        nacelle_inertia=tip_mass * (nacelle["radius_of_gyration_ft"] * FOOT) ** 2,
        gravity_centre_helicopter=np.array([centre["heli_SL_in"], centre["heli_WL_in"]]) * INCH,
        gravity_shift=np.array([centre["shift_X_ft"], centre["shift_Z_ft"]]) * FOOT,
        pivot=np.array(centre["pivot_SL_WL_BL_in"][:2]) * INCH,
        mast_length=data["geometry"]["mast_pivot_to_hub_ft"] * FOOT,
    )


def _change(sources: Sequence[Data], name: str, value: object) -> None:
    """Put one value in the place of another, as named by tables and key; the first source that has it."""
    *tables, key = name.split(".")
    for source in sources:
        table: Any = source
        for part in tables:
            table = table.get(part, {})
        if key in table:
            table[key] = value
            return
    raise InputError("the aircraft's data have no such entry", key=name, mend="name it as in model_choices.toml")


def load_tables(changes: Mapping[str, Any] | None = None) -> AircraftTables:
    """Tables of the XV-15 at 13000 lb, sea level, 589 rpm and the flap schedule.

    Args:
        changes: Other values of our choices or of the sourced inputs, by ``table.key`` as in the data files.

    Raises:
        InputError: There is no such entry.
    """
    (data, choices), lateral = read_data(), read_lateral_data()
    for name, value in (changes or {}).items():
        _change((choices, data, lateral), name, value)
    rotor_speed = rpm(data["rotor"]["rpm_heli_conversion"])
    # The same function as Xv15.at, so that a trim there is an equilibrium here to the last digit.
    density, sound_speed = standard_atmosphere(0.0)
    configuration = Configuration(
        mass=data["mass"]["mass_slug"] * SLUG,
        density=density,
        sound_speed=sound_speed,
        rotor_speed=rotor_speed,
        flap=-1.0,
    )
    return AircraftTables(
        configuration=configuration,
        rotor=read_rotor(data, choices),
        wing=_wing(data, choices),
        body=_body(data, choices),
        tail=_tail(data, choices),
        controls=_controls(data, choices),
        mass=_mass(data, choices),
        lateral=read_lateral(lateral, data, choices),
    )
