"""What ``rtsim trim`` answers, by JSON key, in the units of its keys."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtsim.aircraft.points import TrimPoint
    from rtsim.aircraft.profile import AircraftProfile
    from rtsim.aircraft.variables import Variable

TRAVELS = {"lateral_stick_in": "lateral_stick_travel_in", "pedal_in": "pedal_travel_in"}
"""Half travel of lateral stick and pedals, by their JSON keys."""


def _stops(profile: AircraftProfile) -> tuple[tuple[str, float, float, str], ...]:
    """Stops of controls and gimbal, and what all engines give at most (docs/model.md): key, range, unit."""
    from rtsim.aircraft.controls import control_tables
    from rtsim.protection.limits import load_limits
    from rtsim.systems.settings import all_engines_power
    from rtsim.units import HORSEPOWER, to_deg

    controls, travel = control_tables(profile), _stick_travel(profile)
    elevator, cyclic = to_deg(controls.elevator_limit), to_deg(controls.cyclic_limit)
    return (
        ("stick_in", -travel, travel, "in"),
        ("lever_fraction", 0.0, 1.0, ""),
        ("elevator_deg", -elevator, elevator, "deg"),
        ("cyclic_deg", -cyclic, cyclic, "deg"),
        ("flapping_deg", 0.0, to_deg(load_limits(profile).flapping), "deg"),
        ("engine_power_shp", 0.0, all_engines_power(profile) / HORSEPOWER, "shp"),
    )


def _stick_travel(profile: AircraftProfile) -> float:
    return profile.controls.number("stick_half_travel_in", low=0.1, high=100.0)


def named(
    point: TrimPoint,
    states: tuple[Variable, ...],
    inputs: tuple[Variable, ...],
    outputs: tuple[Variable, ...],
) -> dict[str, float]:
    """Values of a trim by the names of its variables; lateral ones that it does not have are zero.

    Args:
        point: The trim.
        states: Its states.
        inputs: Its inputs.
        outputs: Its outputs.
    """
    values: dict[str, float] = {}
    for variables, vector in ((states, point.x), (inputs, point.u), (outputs, point.y)):
        # A symmetric trim has the symmetric variables alone; the others are zero.
        values |= {variable.name: 0.0 for variable in variables}
        values |= {variable.name: float(value) for variable, value in zip(variables, vector, strict=False)}
    return values


def trim_result(
    where: tuple[float, float],
    source: str,
    profile: AircraftProfile,
    values: dict[str, float],
    configuration: tuple[float, float],
    converged: bool,
    true_over_calibrated: float,
) -> dict[str, Any]:
    """The answer.

    Args:
        where: Airspeed [kn] and nacelle angle [deg] asked for.
        source: What answers: ``nonlinear`` or ``database``.
        profile: The aircraft.
        values: From ``named``.
        configuration: Flaps [deg], rotor speed [rpm].
        converged: Whether there is a trim.
        true_over_calibrated: True over calibrated airspeed.
    """
    from rtsim.corridor.boundaries import load_corridor
    from rtsim.faults.fault import transmission_efficiency
    from rtsim.units import HORSEPOWER, INCH_POUND, POUND_FORCE, deg, kt, to_deg

    flap_deg, rotor_rpm = configuration
    corridor = load_corridor("design", profile).in_true_airspeed(true_over_calibrated)
    solved = {
        "pitch_deg": to_deg(values["pitch"]),
        "stick_in": values["stick"] * _stick_travel(profile),
        "elevator_deg": to_deg(values["elevator"]),
        "cyclic_deg": to_deg(values["cyclic_1s"]),
        "collective_75_deg": to_deg(values["collective_75"]),
        "lever_fraction": values["lever"],
        "thrust_per_rotor_lb": values["thrust"] / POUND_FORCE,
        "power_shp": values["power"] / HORSEPOWER,
        "engine_power_shp": values["power"] / HORSEPOWER / transmission_efficiency(profile),
        "mast_torque_inlb": values["torque"] / INCH_POUND,
        "flapping_deg": to_deg(math.hypot(values["flap_1c"], values["flap_1s"])),
        **_lateral_result(values),
    }
    return {
        "airspeed_kt": where[0],
        "nacelle_deg": where[1],
        "flap_deg": flap_deg,
        "rotor_rpm": rotor_rpm,
        # where nothing was solved, the last iterate is no answer
        **(solved if converged else dict.fromkeys(solved)),
        "converged": converged,
        "beyond_limits": _beyond_limits(solved, profile) if converged else [],
        "inside_corridor": corridor.inside(kt(where[0]), deg(where[1])),
        "source": source,
    }


def _lateral_result(values: dict[str, float]) -> dict[str, float]:
    """What a trim is like out of the plane of symmetry, by JSON key."""
    from rtsim.aircraft.xv15.data_reader import read_lateral_data
    from rtsim.units import INCH_POUND, to_deg

    travel = read_lateral_data()["controls"]
    value = values.get
    u, v, w = (value(name, 0.0) for name in ("u", "v", "w"))

    def flapping(side: float) -> float:
        along, across = (values[n] + side * value(f"{n}_difference", 0.0) for n in ("flap_1c", "flap_1s"))
        return to_deg(math.hypot(along, across))

    hands = {key: value(key.removesuffix("_in"), 0.0) * travel[name] for key, name in TRAVELS.items()}
    return {
        "bank_deg": to_deg(value("bank", 0.0)),
        "sideslip_deg": to_deg(math.atan2(v, math.hypot(u, w))) if v != 0.0 else 0.0,
        **hands,
        "aileron_deg": to_deg(value("aileron", 0.0)),
        "rudder_deg": to_deg(value("rudder", 0.0)),
        "differential_collective_deg": to_deg(value("collective_difference", 0.0)),
        "differential_cyclic_deg": to_deg(value("cyclic_difference", 0.0)),
        "flapping_right_deg": flapping(1.0),
        "flapping_left_deg": flapping(-1.0),
        "mast_torque_right_inlb": (values["torque"] + value("torque_difference", 0.0)) / INCH_POUND,
        "mast_torque_left_inlb": (values["torque"] - value("torque_difference", 0.0)) / INCH_POUND,
        "load_factor": values["load_factor"],
    }


def _beyond_limits(solved: dict[str, float], profile: AircraftProfile) -> list[str]:
    """What a trim asks of the aircraft that it cannot give, in words: the equations know no stops."""
    found = []
    for key, low, high, unit in _stops(profile):
        if not low - 1e-9 <= solved[key] <= high + 1e-9:
            name = key.removesuffix(f"_{unit}").removesuffix("_fraction").replace("_", " ")
            found.append(f"{name} {solved[key]:.3g} {unit}".rstrip() + f" (limits {low:g} to {high:g})")
    return found
