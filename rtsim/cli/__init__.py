"""The ``rtsim`` command, one module per group of commands: the only part of rtsim that imports telemetry, scenarios."""

import os
import sys


def _leave_current_folder() -> None:
    """Import nothing from the current folder, unless rtsim itself is there; named plug-ins are found."""
    root = os.path.realpath(f"{__file__}/../../..")
    try:
        here = os.path.realpath(os.curdir)
    except OSError:
        return  # the folder is gone, and nothing can be imported from it
    # Only modules that every interpreter has loaded are used: any other might be one of that folder.
    sys.path[:] = [entry for entry in sys.path if here == root or os.path.realpath(entry or os.curdir) != here]


_leave_current_folder()
