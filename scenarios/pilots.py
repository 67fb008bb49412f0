"""Finds a user's own pilot: ``MODULE:CLASS``, or the name of an entry point in the group ``rtsim.pilots``."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from rtsim.command import Pilot
from rtsim.errors import InputError
from scenarios.problems import closest, suggestion

ENTRY_POINT_GROUP = "rtsim.pilots"
"""Group under which an installed package offers pilots by name."""
BUILT_IN_PILOT = "mocm"
"""The pilot that needs no plug-in."""
HAND_PILOT = "mavlink"
"""A person behind MAVLink; the built-in pilot holds the start until the first sticks arrive."""

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
    if name in {BUILT_IN_PILOT, HAND_PILOT}:
        return None
    target = _from_module(name) if ":" in name else _from_entry_point(name)
    if not callable(target) or not callable(getattr(target, "step", None)):
        raise InputError(
            "is not a pilot: it is no class with a method step(sensors, reference, dt)",
            key="--pilot",
            value=name,
            mend="see rtsim.command.Pilot",
        )

    def make() -> Pilot:
        try:
            made: Pilot = target()
        except Exception as error:
            raise InputError(
                f"the pilot cannot be made: {type(error).__name__}: {error}",
                key="--pilot",
                value=name,
                mend="its class must take no arguments",
            ) from error
        return made

    return make


def _from_module(name: str) -> Any:
    module_name, _, class_name = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or module_name
        own = module_name == missing or module_name.startswith(f"{missing}.")
        problem = f"there is no module {missing}" if own else f"its module needs {missing}, which is not installed"
        raise InputError(
            problem,
            key="--pilot",
            value=name,
            mend="name a module of the current directory or an installed one" if own else f"install {missing}",
        ) from error
    except Exception as error:
        raise InputError(
            f"the module {module_name} cannot be imported: {type(error).__name__}: {error}",
            key="--pilot",
            value=name,
            mend="correct the module",
        ) from error
    target = getattr(module, class_name, None)
    if target is None:
        classes = [key for key, value in vars(module).items() if isinstance(value, type) and hasattr(value, "step")]
        raise InputError(
            f"the module {module_name} has no class {class_name}",
            key="--pilot",
            value=name,
            allowed=", ".join(closest(class_name, classes)) or None,
            mend=suggestion(class_name, classes, otherwise="name a class with a method step"),
        )
    return target


def _from_entry_point(name: str) -> Any:
    offered = {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}
    if name not in offered:
        choices = [BUILT_IN_PILOT, HAND_PILOT, *offered]
        raise InputError(
            "is not a pilot",
            key="--pilot",
            value=name,
            allowed=", ".join([*closest(name, choices), "MODULE:CLASS"]),
            mend=suggestion(name, choices, otherwise="choose one"),
        )
    try:
        return offered[name].load()
    except Exception as error:
        raise InputError(
            f"the entry point cannot be loaded: {type(error).__name__}: {error}",
            key="--pilot",
            value=name,
            mend="reinstall the package that offers it",
        ) from error
