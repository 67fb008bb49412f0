"""The live picture of ``rtsim joystick``: bars for the sticks, and what the vehicle says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from telemetry.joystick.mapping import Controls
from telemetry.joystick.sender import VehicleView

if TYPE_CHECKING:
    from rich.console import RenderableType

_WIDTH = 41
_MODES = {
    0x00010000: "Manual",
    0x00070000: "Stabilized",
    0x00020000: "Altitude",
    0x00030000: "Position",
    0x03040000: "Hold (virtual pilot)",
}
_SHOWN = (
    ("nac_deg", "nacelle", "deg", 1),
    ("airspeed_kt", "airspeed", "kn", 0),
    ("altitude_m", "altitude", "m", 0),
    ("climb_m_s", "climb", "m/s", 1),
    ("pitch_deg", "pitch", "deg", 1),
    ("bank_deg", "bank", "deg", 0),
    ("heading_deg", "heading", "deg", 0),
    ("corr_lo", "above the low side", "kn", 0),
    ("corr_hi", "below the high side", "kn", 0),
    ("flap_deg", "flapping", "deg", 1),
    ("trq_pct", "torque", "%", 0),
)


def bar(value: float, *, centred: bool) -> str:
    """A value as a bar of text.

    Args:
        value: -1 to 1 where it is centred, else 0 to 1.
        centred: Whether 0 is in the middle.
    """
    share = 0.5 * (1.0 + value) if centred else value
    place = round(min(max(share, 0.0), 1.0) * (_WIDTH - 1))
    middle = _WIDTH // 2
    cells = []
    for cell in range(_WIDTH):
        filled = min(place, middle) <= cell <= max(place, middle) if centred else cell <= place
        cells.append("#" if cell == place else "=" if filled else "|" if centred and cell == middle else ".")
    return "".join(cells)


def picture(controls: Controls, vehicle: VehicleView, *, device: str, rate_hz: float) -> RenderableType:
    """The whole picture.

    Args:
        controls: What is sent now.
        vehicle: What the vehicle said last.
        device: Name of the device.
        rate_hz: Messages per second.
    """
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    sticks = Table.grid(padding=(0, 2))
    rows = (
        ("stick (forward right)", controls.stick, True),
        ("power lever", controls.lever, False),
        ("lateral stick", controls.lateral, True),
        ("pedals", controls.yaw, True),
    )
    for name, value, centred in rows:
        sticks.add_row(name, Text(bar(value, centred=centred)), f"{value:+.2f}" if centred else f"{value:.2f}")
    lines: list[RenderableType] = [Text(f"{device} -> MANUAL_CONTROL at {rate_hz:.0f} Hz", style="bold"), sticks]
    if not vehicle.system_id:
        lines.append(Text("Waiting for a vehicle: start rtsim fly manual_flight --pilot mavlink", style="yellow"))
    else:
        lines.append(_vehicle_line(vehicle))
        if vehicle.applied_lever is None:
            lines.append(Text("Sends no sticks until the vehicle says where its power lever is", style="yellow"))
        values = [
            f"{label} {vehicle.values[key]:.{digits}f} {unit}"
            for key, label, unit, digits in _SHOWN
            if key in vehicle.values
        ]
        lines.append(Text("   ".join(values)))
        lines += [Text(f"  {text}", style="dim") for text in vehicle.texts[-4:]]
    return Group(*lines)


def _vehicle_line(vehicle: VehicleView) -> RenderableType:
    from rich.text import Text

    if not vehicle.present:
        return Text(f"Vehicle {vehicle.system_id} is silent", style="red")
    mode = _MODES.get(vehicle.custom_mode, f"mode {vehicle.custom_mode:#010x}")
    return Text(f"Vehicle {vehicle.system_id}: {mode}, {'armed' if vehicle.armed else 'not armed'}", style="green")
