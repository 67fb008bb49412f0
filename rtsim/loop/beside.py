"""Compiles half of a first flight's kernels in a process beside it: they meet in the kernel cache.

numba compiles under one lock, so threads do not help. The flight compiles the aircraft and the frame, this the pilot,
the monitor and the limit watch. Should it fail or hang, the flight compiles them itself.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import subprocess
from typing import Any

import numba

from rtsim.kernels import progress, store
from rtsim.processes import Stillness, end_process, ending, start_process

_CONFIGURATION: Any = numba.config  # its names are made at run time
CHILD = "RTSIM_COMPILES_BESIDE"
"""Set in the environment of the process beside."""
KERNELS_ALONE, KERNELS_BESIDE = 107, 69
"""Kernels that a first flight of the LPV aircraft compiles: alone, and with a process beside it."""
HANG_S = 10.0
"""A process beside that does nothing for so long is ended [s]."""
_wanted: list[str] = []
_running: list[subprocess.Popen[bytes]] = []


def also(compile_it: str) -> None:
    """Have the process beside call a function that compiles what is needed after the flight.

    Args:
        compile_it: ``MODULE:FUNCTION``; this room does not know those above it.
    """
    if compile_it not in _wanted:
        _wanted.append(compile_it)


def start(plant: str) -> None:
    """Begin to compile beside, if this is the first flight of a plant and there is a core to spare.

    Args:
        plant: ``lpv`` or ``nonlinear``.
    """
    if _running or CHILD in os.environ or _CONFIGURATION.DISABLE_JIT or store.read(_marker(plant)) is not None:
        return
    progress.expect(KERNELS_ALONE)
    if (os.cpu_count() or 1) < 2 or store.writable_folder() is None:
        return
    with contextlib.suppress(OSError):  # then the flight compiles all of it
        _running.append(
            start_process(
                "rtsim.loop.compile_beside",
                *_wanted,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                variables={CHILD: "1"},
            )
        )
        progress.expect(KERNELS_BESIDE)
        atexit.register(_end)


def finish(plant: str) -> None:
    """Wait until all is compiled that the process beside compiles, and remember that this plant has been flown.

    Args:
        plant: ``lpv`` or ``nonlinear``.
    """
    for process in _running:
        stillness = Stillness(process)
        code = None
        while code is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = process.wait(0.2)
            if code is None and stillness.end_after(HANG_S):
                break
        end_process(process, patience_s=0.5)
        if code != 0:
            logging.getLogger(__name__).warning(
                "The process that compiles beside the flight ended unexpectedly (%s); the flight compiles the rest.",
                ending(process),
            )
    _running.clear()
    if CHILD not in os.environ and not _CONFIGURATION.DISABLE_JIT and store.read(_marker(plant)) is None:
        store.write(_marker(plant), b"")


def _marker(plant: str) -> str:
    """Piece that is kept once a flight of a plant has been compiled."""
    return f"compiled-{plant}"


def _end() -> None:
    """The flight gave up while it was compiled: so does the process beside it."""
    for process in _running:
        end_process(process)
