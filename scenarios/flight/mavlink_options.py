"""How a flight talks MAVLink: what the user may choose, checked and turned into the vehicle's settings."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import rtsim
from rtsim.aids.design import SWITCHES
from rtsim.aircraft.condition import AircraftName
from rtsim.choices import HAND_PILOT
from rtsim.errors import InputError
from rtsim.loop.aircraft import database_of
from rtsim.protection.limits import load_limits
from rtsim.sticks.settings import StickSettings
from rtsim.units import INCH_POUND, deg, to_deg, to_kt, to_rpm
from telemetry.exchange.globe import HomePosition
from telemetry.joystick.stick_map import VehicleMap, load_vehicle_map
from telemetry.mavlink.config import MavlinkConfig, Ratings, endpoints
from telemetry.mavlink.parameters import NOT_STORED, ParameterStore

if TYPE_CHECKING:
    from scenarios.files.scenario import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkOptions:
    """How a flight talks MAVLink."""

    targets: tuple[str, ...] = ()
    """``HOST:PORT`` of ground stations; empty takes 127.0.0.1:14550."""
    bind: str | None = None
    """``HOST:PORT`` to receive on; None takes a free loopback port."""
    allow_network: bool = False
    """Whether MAVLink may leave this machine."""
    signing_key: Path | None = None
    """File with the signing key."""
    parameter_file: Path | None = None
    """Where parameters are stored on request; None takes the user's own place."""
    stick_map: str | None = None
    """Stick map of the vehicle: a library name or a file."""
    autopilot: Literal["px4", "generic"] = "px4"
    """How ground stations decode modes."""
    reboot_resets: bool = False
    """Let the reboot command reset the flight."""
    home: HomePosition = field(default_factory=HomePosition)
    """Start of the flight on the globe."""


def default_parameter_file() -> Path | None:
    """Where parameters are stored where nothing else is said: the user's configuration directory, if he has one."""
    base = os.environ.get("XDG_CONFIG_HOME")
    try:
        return (Path(base) if base else Path.home() / ".config") / "rtsim" / "mavlink_parameters.toml"
    except RuntimeError:  # neither HOME nor an entry for the user
        return None


def mavlink_config(options: MavlinkOptions, scenario: Scenario) -> tuple[MavlinkConfig, str | None]:
    """Settings of the vehicle of a flight.

    Args:
        options: What the user wants.

    Returns:
        The settings, and a warning to print or None.

    Raises:
        InputError: An address, the stick map or the file of parameters is wrong.
    """
    targets, host, port, warning = endpoints(options.targets, allow_network=options.allow_network, bind=options.bind)
    stick_map = load_vehicle_map(options.stick_map)
    parameter_file = options.parameter_file or default_parameter_file()
    if parameter_file is None:
        homeless = "There is no home folder to keep MAVLink parameters in; --mavlink-parameters FILE names a place."
        warning = f"{warning} {homeless}" if warning else homeless
    always = {name: getattr(scenario.options, name) for name in NOT_STORED}
    aids_on = {*scenario.options.aids, *(name for name, on in always.items() if on)}
    config = MavlinkConfig(
        targets=targets,
        bind_host=host,
        bind_port=port,
        autopilot=options.autopilot,
        rate_hz=float(scenario.options.rate_hz),
        ratings=_ratings(scenario.options.aircraft),
        home=dataclasses.replace(options.home, heading_deg=to_deg(scenario.options.heading)),
        aids={name: name in aids_on for name in SWITCHES},
        parameters=stick_settings(stick_map).parameters(),
        parameter_file=str(parameter_file) if parameter_file is not None else None,
        axes={str(control): source for control, source in stick_map.axes.items()},
        buttons={str(function): bit for function, bit in stick_map.buttons.items()},
        signing_key_file=str(options.signing_key) if options.signing_key else None,
        reboot_resets=options.reboot_resets,
        title=scenario.name,
        version=rtsim.__version__,
    )
    if options.parameter_file:  # what somebody named must be right; an old file of the user's own is only told of
        ParameterStore(config.aids, config.parameters).load(options.parameter_file)
    return config, warning


def _ratings(aircraft: AircraftName) -> Ratings:
    """Full torque and rotor speed of an aircraft; the shipped one's need not wait for its database."""
    if not aircraft:
        return Ratings()
    database = database_of(aircraft)
    torque = load_limits(database.profile).torque
    return Ratings(
        torque_inlb=torque.cruise / INCH_POUND,
        hover_torque_inlb=torque.takeoff / INCH_POUND,
        hover_nacelle_deg=to_deg(torque.takeoff_nacelle),
        hover_airspeed_kt=to_kt(torque.takeoff_airspeed),
        rotor_speed_rpm=to_rpm(database.governed_speed) if database.governed_speed > 0.0 else Ratings().rotor_speed_rpm,
    )


def stick_settings(stick_map: VehicleMap) -> StickSettings:
    """Shaping and nacelle switch of a stick map.

    Args:
        stick_map: The map.
    """
    return StickSettings(
        dead_band=stick_map.shape.dead_band,
        expo=stick_map.shape.expo,
        scale=stick_map.shape.scale,
        detents=stick_map.nacelle.detents,
        nacelle_rate=deg(stick_map.nacelle.rate_deg_s),
    )


def flown_by_hand(pilot: str) -> bool:
    """Whether a scenario's pilot is a person behind MAVLink.

    Args:
        pilot: Name of the pilot.
    """
    return pilot == HAND_PILOT


def refuse_unpaced(scenario: Scenario, *, paced: bool) -> None:
    """Refuse MAVLink in a flight that is flown as fast as it goes: nobody could follow it.

    Args:
        paced: Whether the flight is paced.

    Raises:
        InputError: It is not.
    """
    if not paced:
        raise InputError(
            "MAVLink needs a paced flight",
            key="--speed",
            value="max",
            allowed="multiples of real time",
            mend="leave --speed out" if flown_by_hand(scenario.options.pilot) else "leave --mavlink out",
        )
