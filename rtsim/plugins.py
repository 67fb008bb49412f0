"""A pilot or law of the user's own: found by ``MODULE:CLASS`` or by an entry point's name, one way for all."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.machinery import PathFinder
from importlib.metadata import entry_points
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from rtsim.errors import InputError, closest, suggestion
from rtsim.guests import GuestError, visited


@dataclass(frozen=True, slots=True)
class PluginKind:
    """What can be plugged in at one place."""

    noun: str
    """What it is called, with its article."""
    option: str
    """The option of ``rtsim fly`` that names it."""
    entry_point_group: str
    """Group under which an installed package offers some by name."""
    built_in: tuple[str, ...]
    """Names that need no plug-in."""
    method: str
    """The method its class must have, as people write it."""
    page: str
    """Where that method is described."""


_searched: set[str] = set()
"""Folders in which plug-ins have been looked for."""


def find_plugin(name: str, kind: PluginKind) -> Callable[[], Any]:
    """The class behind a name.

    Args:
        name: ``MODULE:CLASS``, the module also looked for in the current directory, or an entry point's name.
        kind: What it is to be.

    Returns:
        The class, which has the method but has not been called.

    Raises:
        InputError: There is none of that name, it cannot be imported, or it lacks the method.
    """
    target = _from_module(name, kind) if ":" in name else _from_entry_point(name, kind)
    if not callable(target) or not callable(getattr(target, "step", None)):
        raise InputError(
            f"is not {kind.noun}: it is no class with a method {kind.method}",
            key=kind.option,
            value=name,
            mend=f"see {kind.page}",
        )
    found: Callable[[], Any] = target
    return found


def make_plugin(target: Callable[[], Any], name: str, kind: PluginKind) -> Any:
    """Make a fresh one.

    Args:
        target: The class, from :func:`find_plugin`.
        name: The name it was found by.
        kind: What it is.

    Raises:
        InputError: Its class wants arguments or failed.
    """
    try:
        return visited(target)
    except GuestError as error:
        raise InputError(
            f"the {kind.noun.partition(' ')[2]} cannot be made: {error}",
            key=kind.option,
            value=name,
            mend="its class must take no arguments",
        ) from error


def _imported(name: str, folder: str) -> ModuleType:
    """Import a module that was named, from a folder before all others; what only happens to lie there is not.

    The folder stands last on the path, for what the module itself imports from beside it.
    """
    if folder not in sys.path:
        sys.path.append(folder)
    _searched.add(folder)
    first = name.partition(".")[0]
    if first not in sys.modules:
        specification = PathFinder.find_spec(first, [folder])
        if specification is not None and specification.loader is not None:
            module = module_from_spec(specification)
            sys.modules[first] = module
            try:
                specification.loader.exec_module(module)
            except BaseException:
                del sys.modules[first]
                raise
    return importlib.import_module(name)


def _from_module(name: str, kind: PluginKind) -> Any:
    module_name, _, class_name = name.partition(":")
    if not (module_name and class_name):
        raise InputError("is half a name", key=kind.option, value=name, mend="write MODULE:CLASS")
    try:
        module = visited(_imported, module_name, str(Path.cwd()))
    except GuestError as error:
        if isinstance(error.__cause__, ModuleNotFoundError):
            missing = error.__cause__.name or module_name
            own = module_name == missing or module_name.startswith(f"{missing}.")
            raise InputError(
                f"there is no module {missing}" if own else f"its module needs {missing}, which is not installed",
                key=kind.option,
                value=name,
                mend="name a module of the current directory or an installed one" if own else f"install {missing}",
            ) from error
        raise InputError(
            f"the module {module_name} cannot be imported: {error}",
            key=kind.option,
            value=name,
            mend="correct the module",
        ) from error
    target = getattr(module, class_name, None)
    mine = Path.cwd() / f"{module_name}.py"
    found = Path(getattr(module, "__file__", None) or "built in")
    if target is None and mine.exists() and str(found.parent) not in _searched:
        raise InputError(
            f"its module is not found because an installed one is called {module_name} too",
            key=kind.option,
            value=name,
            mend=f"give {mine.name} another name",
        )
    if target is None:
        classes = [key for key, value in vars(module).items() if isinstance(value, type) and hasattr(value, "step")]
        raise InputError(
            f"the module {module_name} has no class {class_name}",
            key=kind.option,
            value=name,
            allowed=", ".join(closest(class_name, classes)) or None,
            mend=suggestion(class_name, classes, otherwise="name a class with a method step"),
        )
    return target


def _from_entry_point(name: str, kind: PluginKind) -> Any:
    offered = {point.name: point for point in entry_points(group=kind.entry_point_group)}
    if name not in offered:
        choices = [*kind.built_in, *offered]
        raise InputError(
            f"is not {kind.noun}",
            key=kind.option,
            value=name,
            allowed=", ".join([*choices, "MODULE:CLASS"]),
            mend=suggestion(name, choices, otherwise="choose one"),
        )
    try:
        return visited(offered[name].load)
    except GuestError as error:
        raise InputError(
            f"the entry point cannot be loaded: {error}",
            key=kind.option,
            value=name,
            mend="reinstall the package that offers it",
        ) from error
