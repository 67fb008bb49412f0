"""TOML files, read in one way: every fault is one sentence (``rtsim.outside`` opens them)."""

from __future__ import annotations

import re
import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from rtsim.errors import InputError, closest, suggestion
from rtsim.outside import LARGEST_TEXT, read_text

_LONGEST_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++\s*+\.\s*+){100}""")
"""Dotted keys take the parser a time that grows with the square of their length."""
_WHOLE_NUMBERS = range(-(2**63), 2**63)


def shipped_names(folder: str) -> list[str]:
    """Names of the TOML files that come with rtsim in a folder, sorted.

    Args:
        folder: The folder, such as ``scenarios/library``.
    """
    names = (entry.name for entry in _shipped(folder).iterdir())
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def shipped_toml(folder: str, name: str) -> dict[str, Any]:
    """The content of a file that comes with rtsim.

    Args:
        folder: Its folder, such as ``scenarios/library``.
        name: Its name with the ending.
    """
    return tomllib.loads(_shipped_text(folder, name))


FEW = 8
"""As many names as a message lists."""


def named_text(
    name_or_path: str | Path, *, folder: str, noun: str, key: str, largest: int = LARGEST_TEXT
) -> tuple[str, str]:
    """The text of a file given by path, or of one that comes with rtsim given by name.

    Args:
        name_or_path: The name, or a path; a word with a ``/`` or ending in ``.toml`` is a path.
        folder: Where files of this kind lie that come with rtsim.
        noun: What such a file is called, without article.
        key: The option or argument that gives the name.
        largest: Size of the largest file that is read [bytes].

    Returns:
        The text, and how to call the file in messages.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    text, names = str(name_or_path), shipped_names(folder)
    if isinstance(name_or_path, Path) or "/" in text or text.endswith(".toml"):
        missing = f"check the path, or take one of {', '.join(names)}"
        return read_text(name_or_path, noun=noun, largest=largest, missing=missing), text
    if text in names:
        return _shipped_text(folder, f"{text}.toml"), text
    near = closest(text, names)
    if len(near) > FEW:
        near = [*near[: FEW - 1], f"and {len(near) - FEW + 1} more (rtsim {noun}s lists them)"]
    raise InputError(
        f"is not a {noun} of the library",
        key=key,
        value=text,
        allowed=", ".join(near),
        mend=f"{suggestion(text, names, otherwise='choose one')}, or give a path ending in .toml",
    )


def parse_toml(text: str, *, file: str) -> dict[str, Any]:
    """The tables of a text.

    Args:
        text: The TOML text.

    Raises:
        InputError: It is not valid TOML.
    """
    deep = InputError("is nested too deeply", file=file, mend="write flat tables")
    if _LONGEST_KEY.search(text):
        raise deep
    try:
        document = tomllib.loads(text)
        _refuse_large_numbers(document, "", file)
    except InputError:
        raise
    except ValueError as error:  # a number of more than 4300 digits is one that is no TOMLDecodeError
        raise InputError(f"is not valid TOML: {_lower(str(error))}", file=file, mend="correct this line") from None
    except RecursionError:
        raise deep from None
    return document


def _refuse_large_numbers(value: Any, key: str, file: str) -> None:
    """Whole numbers of TOML have 64 bits; Python's know no end, and cannot be taken for decimals then."""
    if isinstance(value, dict):
        for name, part in value.items():
            _refuse_large_numbers(part, f"{key}.{name}" if key else name, file)
    elif isinstance(value, list):
        for place, part in enumerate(value):
            _refuse_large_numbers(part, f"{key}[{place}]", file)
    elif isinstance(value, int) and value not in _WHOLE_NUMBERS:
        raise InputError(
            "is too large a number", file=file, key=key, allowed="whole numbers of 64 bits", mend="correct it"
        )


def read_toml(path: str | Path, *, noun: str, may_be_empty: bool = False) -> dict[str, Any]:
    """The tables of a file that somebody gave.

    Args:
        path: The file.
        noun: What it should be, without article.
        may_be_empty: Whether an empty file means something.

    Raises:
        InputError: It cannot be read, or is not valid TOML.
    """
    return parse_toml(read_text(path, noun=noun, may_be_empty=may_be_empty), file=str(path))


def _shipped(folder: str) -> Traversable:
    package, *rest = folder.split("/")
    return resources.files(package).joinpath(*rest)


def _shipped_text(folder: str, name: str) -> str:
    return (_shipped(folder) / name).read_text(encoding="utf-8")


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:]
