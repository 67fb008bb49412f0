"""Settings and fixtures for every test."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

# One thread per test process: the suite runs in parallel, and bit-exact comparisons must not meet threaded sums.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# A first call may compile a kernel, so no deadline; derandomized, so that a red build stays red until it is mended.
settings.register_profile(
    "rtsim", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("rtsim")
