"""TOML files, read in one way: size, encoding and layout are checked, and every fault is one sentence."""

from __future__ import annotations

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from rtsim.errors import InputError, closest, suggestion

MAX_BYTES = 1_000_000
"""A larger file is refused before it is read [bytes]."""


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


def named_text(
    name_or_path: str | Path, *, folder: str, noun: str, key: str, largest: int = MAX_BYTES
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
    raise InputError(
        f"is not a {noun} of the library",
        key=key,
        value=text,
        allowed=", ".join(closest(text, names)),
        mend=f"{suggestion(text, names, otherwise='choose one')}, or give a path ending in .toml",
    )


def read_text(path: str | Path, *, noun: str, largest: int = MAX_BYTES, missing: str = "check the path") -> str:
    """The text of a file that somebody gave.

    Args:
        path: The file.
        noun: What it should be, without article.
        largest: Size of the largest file that is read [bytes].
        missing: What to do where there is none.

    Raises:
        InputError: It is not there, no file, too large, no text, or must not be read.
    """
    file, shown = Path(path), str(path)
    try:
        if file.is_dir():
            raise InputError("is a directory", file=shown, mend=f"name a {noun} file")
        if file.stat().st_size > largest:
            raise InputError(f"is too large for a {noun}", file=shown, allowed=f"at most {largest} bytes")
        return file.read_text(encoding="utf-8-sig")  # some editors begin UTF-8 files with a mark
    except FileNotFoundError:
        raise InputError("does not exist", file=shown, mend=missing) from None
    except UnicodeDecodeError as error:
        problem = f"is not a text file (byte {error.start} is not UTF-8)"
        raise InputError(problem, file=shown, mend="save it as UTF-8") from None
    except OSError as error:
        problem = f"cannot be read: {_lower(error.strerror or str(error))}"
        raise InputError(problem, file=shown, mend="check its permissions") from None


def parse_toml(text: str, *, file: str) -> dict[str, Any]:
    """The tables of a text.

    Args:
        text: The TOML text.

    Raises:
        InputError: It is not valid TOML.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {_lower(str(error))}", file=file, mend="correct this line") from None
    except RecursionError:
        raise InputError("is nested too deeply", file=file, mend="write flat tables") from None


def read_toml(path: str | Path, *, noun: str) -> dict[str, Any]:
    """The tables of a file that somebody gave.

    Args:
        path: The file.
        noun: What it should be, without article.

    Raises:
        InputError: It cannot be read, or is not valid TOML.
    """
    return parse_toml(read_text(path, noun=noun), file=str(path))


def _shipped(folder: str) -> Traversable:
    package, *rest = folder.split("/")
    return resources.files(package).joinpath(*rest)


def _shipped_text(folder: str, name: str) -> str:
    return (_shipped(folder) / name).read_text(encoding="utf-8")


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:]
