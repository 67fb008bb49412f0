"""What a user has set for other programs, kept away from this one: neither a result nor an end depends on it."""

from __future__ import annotations

import io
import os
import sys
import warnings

NUMBA_SETTINGS = frozenset({"NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT"})
"""Those of numba that are ours to offer (docs/development.md); any other might change or end what is flown."""


def leave_settings_of_others() -> None:
    """Forget settings of numba and Python that are meant for other programs; print what a stream cannot show as ?."""
    for name in list(os.environ):
        if name.startswith("NUMBA_") and name not in NUMBA_SETTINGS:
            del os.environ[name]
    if os.environ.pop("PYTHONWARNINGS", None):  # the filters that Python begins with
        warnings.resetwarnings()
        for category in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.simplefilter("ignore", category)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
