"""Where compiled kernels are kept: one folder for each state of the kernels' sources.

numba looks at the source file of a cached function and not at those of the functions it calls, which are compiled into
it. A kernel that was changed would go on being flown in its old form by its callers. The sources of all kernels, and of
what they take constants from, are therefore part of the folder's name.

Legend:
    root: The folder that holds the packages.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import time
from pathlib import Path

PACKAGES = ("rtsim", "scenarios")
"""Packages with kernels."""
FORGOTTEN_AFTER_S = 30 * 86_400.0
"""A folder not used for as long is thrown away when a new one is made [s]."""


_IMPORT = re.compile(
    r"^[ \t]*(?:from ((?:rtsim|scenarios)[\w.]*) import ([^\n(]+|\([^)]*\))|import ((?:rtsim|scenarios)[\w.]*))",
    re.MULTILINE,
)


def kernel_sources(root: Path) -> dict[Path, bytes]:
    """Every file that compiled code is made from: the kernels, and what they import of this project.

    Returns:
        Contents by path. An import inside a function or a ``try`` counts too.
    """
    left = [path for package in PACKAGES for path in (root / package).rglob("*_kernels.py")]
    found: dict[Path, bytes] = {}
    while left:
        path = left.pop()
        if path in found:
            continue
        found[path] = path.read_bytes()
        for module, names, plain in _IMPORT.findall(found[path].decode("utf-8", "replace")):
            folder = root.joinpath(*(module or plain).split("."))
            given = [folder / f"{name.split()[0]}.py" for name in names.strip("() \n").split(",") if name.strip()]
            left += [file for file in (folder.with_suffix(".py"), *given) if file.is_file()]
    return found


def source_hash(root: Path) -> str:
    """Hash of everything that compiled code is made from."""
    digest = hashlib.sha256()
    for path, content in sorted(kernel_sources(root).items()):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def cache_folder(root: Path) -> Path | None:
    """The folder for kernels of these sources, made if need be, which may be read-only.

    It lies in ``NUMBA_CACHE_DIR`` if that is set, else in ``rtsim/kernels`` of the user's cache.

    Returns:
        The folder; None where there is none and none can be made.
    """
    own, chosen = os.environ.get("NUMBA_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")
    try:
        parent = Path(own) if own else (Path(chosen) if chosen else Path.home() / ".cache") / "rtsim" / "kernels"
        folder = parent / source_hash(root)
        if not folder.is_dir():
            folder.mkdir(parents=True, exist_ok=True)
            if not own:
                _forget_old(parent)
        with contextlib.suppress(OSError):
            os.utime(folder)
        next(folder.iterdir(), None)  # one that cannot be looked into is none
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return None
    return folder


def _forget_old(parent: Path) -> None:
    limit = time.time() - FORGOTTEN_AFTER_S
    for folder in parent.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process forgets the same ones
            if folder.is_dir() and folder.stat().st_mtime < limit:
                shutil.rmtree(folder, ignore_errors=True)
