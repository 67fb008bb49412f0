"""Keeps what takes long to prepare beside the compiled kernels: tables of an aircraft, a database that was read.

A piece is kept under its name and a key that says what it was made from; every source file of rtsim is part of it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rtsim.kernels import store

Piece = TypeVar("Piece")
KEPT = 3
"""Pieces of one name that are kept: those used last."""


def kept(name: str, key: bytes, make: Callable[[], Piece]) -> Piece:
    """Give a piece from an earlier process, or make it and keep it.

    Args:
        name: What it is, as a file name.
        key: What it is made from besides rtsim's sources; another key is another piece.
        make: Makes it; what comes of it must be picklable.
    """
    file = f"{name}-{hashlib.sha256(_sources() + key).hexdigest()[:16]}.kept"
    content = store.read(file)
    if content is not None:
        try:
            return pickle.loads(content)  # type: ignore[no-any-return]
        except Exception:  # noqa: BLE001 - whatever unpickling says: it is made anew
            store.damaged(file)
    piece = make()
    path = store.write(file, pickle.dumps(piece, protocol=pickle.HIGHEST_PROTOCOL))
    if path is not None:
        _forget(path)
    return piece


@functools.cache
def _sources() -> bytes:
    """The state of rtsim's sources: names, sizes and times, since reading them all takes longer than it saves."""
    root = Path(__file__).resolve().parents[1]
    stats = [(path, path.stat()) for path in sorted(root.rglob("*.py"))]
    return repr([(str(path), stat.st_size, stat.st_mtime_ns) for path, stat in stats]).encode()


def _forget(path: Path) -> None:
    """Throw away all but the newest pieces of this name."""
    name = path.name.rpartition("-")[0]
    with contextlib.suppress(OSError):
        others = sorted(path.parent.glob(f"{name}-*.kept"), key=lambda other: other.stat().st_mtime, reverse=True)
        for other in others[KEPT:]:
            other.unlink(missing_ok=True)
