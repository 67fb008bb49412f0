"""What FlightGear needs of us: the aircraft as a folder of files, and the line that starts it."""

from __future__ import annotations

import shlex
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from rtsim.units import FOOT
from rtsim.whole_file import check_writable, write_whole
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import HomePosition
from telemetry.flightgear.ac3d import write_ac3d
from telemetry.flightgear.config import PACKETS_PER_SECOND
from telemetry.flightgear.model import animation_xml, objects
from telemetry.view.airframe import body_point

AIRCRAFT = "rtsim-xv15"
"""What FlightGear calls the aircraft."""
START_SCRIPT = "start-flightgear.sh"
"""Name of the script that starts FlightGear with it."""
_PILOT_EYE = (136.0, 12.0, 103.0)
"""SL, BL, WL of the eye in the right seat [in], by eye."""
_COCKPIT, _OUTSIDE = 0, 1
_SCRIPT = f"""
var view_number = "/sim/current-view/view-number";
setlistener("/sim/signals/fdm-initialized", func {{
    settimer(func {{ setprop(view_number, {_OUTSIDE}); }}, 1);
}});
setlistener(view_number, func(view) {{
    setprop("/sim/hud/visibility[1]", view.getValue() == {_COCKPIT});
}}, 1);
"""
"""Begins outside; the head-up display is for the cockpit."""


def write_aircraft(folder: Path, *, listen: Endpoint, home: HomePosition) -> list[Path]:
    """Write the aircraft and the script that starts FlightGear with it.

    Args:
        folder: Where to; it is made, and files of these names in it are replaced.
        listen: Where FlightGear is to listen.
        home: Where it starts.

    Returns:
        The files.

    Raises:
        OutputError: They cannot be written there.
    """
    aircraft = folder / AIRCRAFT
    check_writable(aircraft / "Models", folder=True)
    (aircraft / "Models").mkdir(parents=True, exist_ok=True)
    script = folder / START_SCRIPT
    texts = {
        aircraft / "Models" / "xv15.ac": write_ac3d(objects()),
        aircraft / "Models" / "xv15.xml": animation_xml("xv15.ac"),
        aircraft / f"{AIRCRAFT}-set.xml": aircraft_xml(),
        script: start_script(folder, listen=listen, home=home),
    }
    for path, text in texts.items():
        write_whole(path, text)
    script.chmod(0o755)
    return list(texts)


def start_command(folder: Path, *, listen: Endpoint, home: HomePosition) -> list[str]:
    """The words that start FlightGear as a window.

    Args:
        folder: Where the aircraft was written.
        listen: Where it is to listen.
        home: Where it starts.
    """
    return [
        "fgfs",
        f"--fg-aircraft={folder.resolve()}",
        f"--aircraft={AIRCRAFT}",
        "--fdm=null",
        f"--native-fdm=socket,in,{PACKETS_PER_SECOND},{listen.host},{listen.port},udp",
        f"--lat={home.latitude_deg:.6f}",
        f"--lon={home.longitude_deg:.6f}",
        f"--altitude={home.altitude_m / FOOT + 100.0:.0f}",
        "--heading=0",
        "--start-date-lat=2026:06:21:12:00:00",
        "--disable-real-weather-fetch",
        "--disable-ai-traffic",
    ]


def start_script(folder: Path, *, listen: Endpoint, home: HomePosition) -> str:
    """The script that starts FlightGear; what it is given is handed on.

    Args:
        folder: Where the aircraft was written.
        listen: Where FlightGear is to listen.
        home: Where it starts.
    """
    first, *words = (shlex.quote(word) for word in start_command(folder, listen=listen, home=home))
    return (
        "#!/bin/sh\n"
        "# Written by rtsim flightgear. Debian keeps fgfs in /usr/games; without a session bus its build would abort.\n"
        'PATH="$PATH:/usr/games"\n'
        "export DBUS_FATAL_WARNINGS=0\n"
        f'exec {" ".join([first, *words])} "$@"\n'
    )


def aircraft_xml() -> str:
    """The file by which FlightGear finds the aircraft."""
    root = ET.Element("PropertyList")
    sim = ET.SubElement(root, "sim")
    _set(sim, "description", "Bell XV-15, flown by rtsim")
    _set(sim, "minimum-fg-version", "2020.3.0")
    _set(sim, "author", "The rtsim authors (Apache-2.0)")
    _set(sim, "flight-model", "null")
    _set(sim, "model/path", f"Aircraft/{AIRCRAFT}/Models/xv15.xml")
    _set(sim, "chase-distance-m", -32.0)
    ahead, right, down = (float(way) for way in body_point(np.array(_PILOT_EYE)))
    eye = ET.SubElement(sim, "view", n=str(_COCKPIT))
    look = {"x-offset-m": right, "y-offset-m": -down, "z-offset-m": -ahead, "pitch-offset-deg": -4.0}
    for name, value in look.items():
        _set(eye, f"config/{name}", value)
    _set(ET.SubElement(sim, "view", n=str(_OUTSIDE)), "config/y-offset-m", 5.0)
    nasal = ET.SubElement(root, "nasal")
    _set(nasal, "rtsim/script", _SCRIPT)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _set(node: ET.Element, path: str, value: str | float) -> None:
    """Set a property below a node."""
    *above, name = path.split("/")
    for step in above:
        found = node.find(step)
        node = found if found is not None else ET.SubElement(node, step)
    kind, text = ("string", value) if isinstance(value, str) else ("double", f"{value:.4g}")
    ET.SubElement(node, name, type=kind).text = text
