"""Who flies: what must be the same here and in every worker, by name, for figures to be those of one machine.

Legend:
    own: Gives what this work needs besides rtsim (database, laws), by name; called here and in every worker.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
from collections.abc import Callable
from pathlib import Path

from rtsim.errors import RtsimError
from rtsim.kernels.cache import PACKAGES, source_hash
from rtsim.versions import versions

Own = Callable[[], dict[str, str]]
SHOWN = 12
"""Signs of a hash that are shown."""


@functools.cache
def _code() -> dict[str, str]:
    """This process's code; what changes on the disk later is not what it runs."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    files = (
        path for package in PACKAGES for ending in ("py", "toml") for path in (root / package).rglob(f"*.{ending}")
    )
    for path in sorted(files):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return versions() | {"kernels": source_hash(root), "sources": digest.hexdigest()}


def identity(own: Own) -> dict[str, str]:
    """Everything that must agree, by name."""
    return _code() | own()


async def answer(own: Own) -> dict[str, str]:
    """A worker's identity, found beside its event loop, which must go on telling the scheduler that it lives."""
    return await asyncio.to_thread(identity, own)


def found_or_told(find: Callable[[], str]) -> str:
    """What something is, or the sentence why it is not there.

    Args:
        find: Finds it.
    """
    try:
        return find()
    except RtsimError as error:
        return str(error).rstrip(".")


def differences(here: dict[str, str], there: dict[str, str]) -> str:
    """What differs, in words.

    Args:
        here: Identity of this process.
        there: Identity of a worker.
    """
    names = [name for name in here | there if here.get(name) != there.get(name)]
    return ", ".join(f"{name} {_short(there.get(name))} instead of {_short(here.get(name))}" for name in names)


def _short(value: str | None) -> str:
    if value is None:
        return "unknown"
    return value[:SHOWN] if len(value) > SHOWN and value.isalnum() else value
