"""Every public object says what it is; every argument of a public function stands under ``Args:`` or in a legend."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re

import pytest
from typer.models import ParameterInfo

import rtsim
import scenarios
import telemetry

PACKAGES = (rtsim, telemetry, scenarios)


def public_modules():
    names = []
    for package in PACKAGES:
        names.append(package.__name__)
        found = pkgutil.walk_packages(package.__path__, package.__name__ + ".")
        names += [info.name for info in found if not any(piece.startswith("_") for piece in info.name.split("."))]
    return names


def unwrapped(obj):
    """The Python function behind a compiled kernel or a decorated one."""
    obj = getattr(obj, "py_func", obj)
    if isinstance(obj, (staticmethod, classmethod)):
        obj = obj.__func__
    return inspect.unwrap(obj) if callable(obj) else obj


def public_functions(module):
    """Qualified name and function of everything public that the module itself defines."""
    for name, member in vars(module).items():
        if name.startswith("_"):
            continue
        if inspect.isclass(member) and member.__module__ == module.__name__:
            for attribute, value in vars(member).items():
                if not attribute.startswith("_") or attribute == "__init__":
                    function = unwrapped(value)
                    if inspect.isfunction(function) and function.__module__ == module.__name__:
                        yield f"{name}.{attribute}", function
        else:
            function = member if told_by_help(member) else unwrapped(member)
            if inspect.isfunction(function) and function.__module__ == module.__name__:
                yield name, function


def told_by_help(function):
    """Whether ``--help`` says what every parameter means: then the docstring is the text above it, and repeats none."""
    if not inspect.isfunction(function) or not function.__module__.startswith("rtsim.cli."):
        return False
    try:
        parameters = inspect.signature(function, eval_str=True).parameters.values()
    except NameError:  # a type that is imported for the checker only: no command
        return False
    notes = [getattr(parameter.annotation, "__metadata__", (None,))[0] for parameter in parameters]
    return bool(notes) and all(isinstance(note, ParameterInfo) and note.help for note in notes)


def public_classes(module):
    for name, member in vars(module).items():
        if not name.startswith("_") and inspect.isclass(member) and member.__module__ == module.__name__:
            yield name, member


def described(docstring, heading):
    """What stands as ``name: text`` at one indent under a heading."""
    section = re.search(rf"^{heading}:\n((?:[ ]+.*\n?|\n)*)", inspect.cleandoc(docstring or ""), flags=re.MULTILINE)
    if section is None:
        return {}
    found = re.findall(
        r"^ {4}\*{0,2}(\w+)(?: \([^)]*\))?: ?((?:.*\n?)(?: {5,}.*\n?)*)", section.group(1), flags=re.MULTILINE
    )
    return {name: " ".join(text.split()) for name, text in found}


def legend_of(module):
    """Names that need no entry: those that mean the same everywhere, and those that the module declares."""
    return described(rtsim.__doc__, "Legend") | described(module.__doc__, "Legend")


def faults_of(qualified_name, function, legend):
    arguments = [name for name in inspect.signature(function).parameters if name not in {"self", "cls"}]
    is_init = qualified_name.endswith("__init__")
    if is_init and (not arguments or (function.__doc__ is None and generated(function))):
        return []
    if not function.__doc__:
        return [f"{qualified_name}: no docstring"]
    own = described(function.__doc__, "Args")
    if told_by_help(function):
        return [f"{qualified_name}: describes {name} again, which --help does" for name in own]
    missing = [name for name in arguments if name not in own and name not in legend]
    faults = [f"{qualified_name}: argument {name} is not described" for name in missing]
    faults += [f"{qualified_name}: describes {name}, which it does not take" for name in own if name not in arguments]
    repeated = [name for name, text in own.items() if legend.get(name) == text]
    return faults + [f"{qualified_name}: describes {name} again, which the legend does" for name in repeated]


def generated(function):
    """Whether a dataclass or NamedTuple wrote this ``__init__``; its fields are documented in the class."""
    return function.__code__.co_filename.startswith("<")


@pytest.mark.parametrize("name", public_modules())
def test_public_objects_are_documented(name):
    module = importlib.import_module(name)
    faults = [] if module.__doc__ else [f"{name}: the module has no docstring"]
    faults += [f"{class_name}: no docstring" for class_name, member in public_classes(module) if not member.__doc__]
    for qualified_name, function in public_functions(module):
        faults += faults_of(qualified_name, function, legend_of(module))
    assert faults == []


def sample(first, second, dt, row):
    """Do something.

    Args:
        first: Described, with a colon: inside.
        third: Not an argument.
        dt: Length
            of a frame [s].
        row: What is special here.
    """


def test_what_is_missing_stale_or_repeated_would_be_found():
    assert faults_of("sample", sample, {"dt": "Length of a frame [s].", "row": "A row."}) == [
        "sample: argument second is not described",
        "sample: describes third, which it does not take",
        "sample: describes dt again, which the legend does",
    ]
    assert legend_of(rtsim)["dt"] == "Length of a frame [s]."


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_every_public_name_exists(package):
    assert [name for name in getattr(package, "__all__", []) if not hasattr(package, name)] == []
