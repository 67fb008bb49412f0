"""Keeps what takes long to prepare beside the compiled kernels: tables of an aircraft, a database that was read.

A piece is kept under its name and a key that says what it was made from; every source file of rtsim is part of it. What
is damaged or cannot be read is made anew; where nothing can be written nothing is kept.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

Piece = TypeVar("Piece")
KEPT = 3
"""Pieces of one name that are kept: those used last."""
_DIGEST = hashlib.sha256().digest_size


def kept(name: str, key: bytes, make: Callable[[], Piece]) -> Piece:
    """Give a piece from an earlier process, or make it and keep it.

    Args:
        name: What it is, as a file name.
        key: What it is made from besides rtsim's sources; another key is another piece.
        make: Makes it; what comes of it must be picklable.
    """
    configuration: Any = numba.config  # its names are made at run time
    folder = configuration.CACHE_DIR
    if not folder:
        return make()
    path = Path(folder) / f"{name}-{hashlib.sha256(_sources() + key).hexdigest()[:16]}.kept"
    found = _read(path)
    if found is not None:
        return found[0]  # type: ignore[no-any-return]
    piece = make()
    _write(path, pickle.dumps(piece, protocol=pickle.HIGHEST_PROTOCOL))
    return piece


@functools.cache
def _sources() -> bytes:
    """The state of rtsim's sources: names, sizes and times, since reading them all takes longer than it saves."""
    root = Path(__file__).resolve().parents[1]
    stats = [(path, path.stat()) for path in sorted(root.rglob("*.py"))]
    return repr([(str(path), stat.st_size, stat.st_mtime_ns) for path, stat in stats]).encode()


def _read(path: Path) -> tuple[Any] | None:
    """The piece in a file, in a tuple; None where there is none that is whole."""
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
            return None
        piece = pickle.loads(memoryview(content)[_DIGEST:])
        os.utime(path)  # used last
        return (piece,)
    except (OSError, ValueError, EOFError, AttributeError, ImportError, pickle.UnpicklingError, TypeError):
        return None


def _write(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    with contextlib.suppress(OSError):
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(hashlib.sha256(content).digest() + content)
            Path(temporary).replace(path)
            _forget(path)
        except OSError:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()


def _forget(path: Path) -> None:
    """Throw away all but the newest pieces of this name."""
    name = path.name.rpartition("-")[0]
    others = sorted(path.parent.glob(f"{name}-*.kept"), key=lambda other: other.stat().st_mtime, reverse=True)
    for other in others[KEPT:]:
        other.unlink(missing_ok=True)
