"""Where compiled kernels and prepared tables are kept between processes: a convenience that nothing depends on.

A piece is read whole and believed by its digest, written whole or not at all. What is damaged is thrown away and made
anew. Where the folder cannot be written (it is read-only, the disk is full, there is none), what it holds is used all
the same and new pieces go to a private folder, which lives as long as this process and is shared with those it starts.
Every trouble is told once.

Legend:
    name: File name of the piece.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import logging
import os
import shutil
import tempfile
from pathlib import Path

from rtsim.kernels.cache import cache_folder

PRIVATE = "RTSIM_PRIVATE_CACHE"
"""Names the private folder to processes that are started from here."""
_DIGEST = hashlib.sha256().digest_size
_told: set[str] = set()
_unwritable: set[Path] = set()


@functools.cache
def main_folder() -> Path | None:
    """The folder of these sources, which may be read-only; None where there is none and none can be made."""
    return cache_folder(Path(__file__).resolve().parents[2])


def read(name: str) -> memoryview | None:
    """A piece as it was written; None where there is none that is whole."""
    for folder in (main_folder(), _private()):
        if folder is None:
            continue
        path = folder / name
        try:
            if not path.is_file():
                if os.path.lexists(path):  # a pipe, a folder, a link to nowhere: nothing that we wrote
                    damaged(name)
                continue
            content = memoryview(path.read_bytes())
        except FileNotFoundError:
            continue
        except OSError as error:
            _tell(f"{path}: cannot be read ({error.strerror}); it is made anew.")
            continue
        if hashlib.sha256(content[_DIGEST:]).digest() == content[:_DIGEST]:
            with contextlib.suppress(OSError):
                os.utime(path)  # used last
            return content[_DIGEST:]
        damaged(name)
    return None


def damaged(name: str) -> None:
    """Throw a piece away that nothing can be made of."""
    for folder in (main_folder(), _private()):
        if folder is not None and os.path.lexists(folder / name):
            _tell(f"{folder / name}: is damaged; it is made anew.")
            with contextlib.suppress(OSError):
                (folder / name).unlink()


def write(name: str, content: bytes) -> Path | None:
    """Keep a piece.

    Args:
        content: What it is.

    Returns:
        The file; None where nothing can be kept.
    """
    folder = writable_folder()
    while folder is not None:
        try:
            _write_whole(folder / name, content)
        except OSError as error:
            folder = _give_up(folder, error)
        else:
            return folder / name
    return None


def writable_folder() -> Path | None:
    """Where new pieces go; a private folder is made where the usual one is known not to take them."""
    folder = main_folder()
    if folder is None:
        return _make_private("there is no folder for it")
    if folder not in _unwritable and not os.access(folder, os.W_OK):
        return _give_up(folder, PermissionError(0, "Permission denied"))
    return folder if folder not in _unwritable else _private()


def _private() -> Path | None:
    named = os.environ.get(PRIVATE)
    return Path(named) if named and Path(named) not in _unwritable else None


def _give_up(folder: Path, error: OSError) -> Path | None:
    """Go on without a folder that took no more."""
    _unwritable.add(folder)
    why = f"{folder}: {error.strerror}"
    if folder == main_folder():
        return _private() or _make_private(why)
    _tell(f"Compiled code cannot be kept ({why}); it is compiled again next time.")
    return None


def _make_private(why: str) -> Path | None:
    """Make the private folder, and say why."""
    if PRIVATE in os.environ:
        return _private()
    try:
        folder = Path(tempfile.mkdtemp(prefix="rtsim-"))
    except OSError as error:
        _tell(f"Compiled code cannot be kept ({why}; {error.strerror}); it is compiled again next time.")
        os.environ[PRIVATE] = ""
        return None
    os.environ[PRIVATE] = str(folder)
    atexit.register(_remove, folder, os.getpid())
    _tell(f"Compiled code cannot be kept ({why}); it is compiled for this time only.")
    return folder


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:  # not in a process forked from it
        shutil.rmtree(folder, ignore_errors=True)


def _write_whole(path: Path, content: bytes) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(hashlib.sha256(content).digest() + content)
        Path(temporary).replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise


def _tell(sentence: str) -> None:
    """Say it once, whatever it is about: more would bury what the user asked for."""
    if not _told:
        logging.getLogger(__name__).warning("%s", sentence)
    _told.add(sentence)
