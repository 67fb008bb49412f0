"""What this rtsim runs on: a history hash is promised for one machine type and one set of these versions."""

from __future__ import annotations

import platform
import sys


def versions() -> dict[str, str]:
    """Versions and machine type that a history hash is promised for."""
    import numba
    import numpy as np

    from rtsim import __version__

    return {
        "rtsim": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
        "byteorder": sys.byteorder,
    }
