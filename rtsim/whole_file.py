"""Files that are whole or not there: written under a temporary name that nobody can guess, then renamed.

A link as target stays, and what it names is replaced; a device or a pipe is written to. What cannot be written is
refused by ``check_writable`` before the work that leads to it.

Legend:
    path: The target; an existing file is replaced.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rtsim.errors import OutputError
from rtsim.outside import status_of


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a new file beside the target; renamed at the end, so that the target is whole or not there.

    Yields:
        The temporary file to write, empty, with the suffix of the target.

    Raises:
        OutputError: Writing or renaming failed; an older file still stands.
    """
    try:
        target = _behind_links(path)
        if _is_special(target):
            with tempfile.TemporaryDirectory(prefix="rtsim-") as folder:
                yield Path(folder) / target.with_suffix(Path(path).suffix).name
                _copy(Path(folder) / target.with_suffix(Path(path).suffix).name, target)
            return
        temporary = _new_file(target)
        try:
            yield temporary
            temporary.replace(target)
        finally:
            # After success there is nothing left under this name; after Ctrl-C or a fault there must not be.
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}.") from error


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file at once.

    Args:
        content: Text, written as UTF-8, or bytes.

    Raises:
        OutputError: It cannot be written; an older file still stands.
    """
    with whole_file(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def check_writable(path: str | os.PathLike[str], *, folder: bool = False) -> None:
    """Refuse a target that cannot be written, before there is anything to write.

    Args:
        path: The target, which may exist or not.
        folder: It is to be a folder, which is made with those above it.

    Raises:
        OutputError: It cannot be written, and why.
    """
    try:
        target = _behind_links(path)
        if folder:
            while not target.exists():
                target = target.parent
            if not target.is_dir():
                raise NotADirectoryError(0, f"{target} is no folder")
            _new_file(target / "probe").unlink()
        elif target.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        elif _is_special(target):
            if not os.access(target, os.W_OK):
                raise PermissionError(0, "Permission denied")
        elif not target.parent.is_dir():
            raise FileNotFoundError(0, f"there is no folder {target.parent}")
        else:
            if target.exists() and not os.access(target, os.W_OK):
                raise PermissionError(0, "it is read-only")
            _new_file(target).unlink()
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}.") from error


def _behind_links(path: str | os.PathLike[str]) -> Path:
    target = Path(os.path.realpath(path))
    if target.is_symlink():
        raise OSError(errno.ELOOP, "its links lead in a circle")
    return target


def _is_special(target: Path) -> bool:
    """Whether something is there that is neither file nor folder: a device, a pipe, a socket."""
    return target.exists() and not target.is_file() and not target.is_dir()


def _new_file(target: Path) -> Path:
    """Make an empty file beside the target, under a name that follows no link, with the permissions of the target."""
    name = f".{target.stem[:100]}.{secrets.token_hex(8)}.part{target.suffix[:20]}"
    there = status_of(target)
    mode = there.st_mode & 0o777 if there else 0o666
    temporary = target.with_name(name)
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), mode))
    return temporary


def _copy(source: Path, target: Path) -> None:
    """Send a file to a device or a pipe."""
    with source.open("rb") as content, target.open("wb", buffering=0) as stream:
        shutil.copyfileobj(content, stream)
