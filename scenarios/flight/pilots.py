"""Finds a user's own pilot: ``MODULE:CLASS``, or the name of an entry point in the group ``rtsim.pilots``."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from rtsim.choices import BUILT_IN_PILOT, HAND_PILOT
from rtsim.command import Pilot
from rtsim.plugins import PluginKind, find_plugin, make_plugin

PILOT_PLUGIN = PluginKind(
    noun="a pilot",
    option="--pilot",
    entry_point_group="rtsim.pilots",
    built_in=(BUILT_IN_PILOT, HAND_PILOT),
    method="step(sensors, reference, dt)",
    page="rtsim.command.Pilot",
)
"""A pilot as plug-in."""

PilotFactory = Callable[[], Pilot]


def load_pilot(name: str) -> PilotFactory | None:
    """The plug-in behind a pilot's name.

    Args:
        name: ``mocm``, ``mavlink``, an entry point's name, or ``MODULE:CLASS``; modules are also looked for in the
            current directory.

    Returns:
        Something that makes a fresh pilot, or None for the built-in one and a person behind MAVLink.

    Raises:
        InputError: If there is no such pilot, or it has no ``step`` method.
    """
    if name in PILOT_PLUGIN.built_in:
        return None
    target = find_plugin(name, PILOT_PLUGIN)

    def make() -> Pilot:
        return cast("Pilot", make_plugin(target, name, PILOT_PLUGIN))

    return make
