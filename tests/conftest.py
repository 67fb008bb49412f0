"""Settings and fixtures for every test."""

from __future__ import annotations

import gc
import os
import signal
import warnings
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# One thread per test process: the suite runs in parallel, and bit-exact comparisons must not meet threaded sums.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# A shell starts what runs in the background with these ignored, and what is ignored is inherited.
for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

# A first call may compile a kernel, so no deadline; derandomized, so that a red build stays red until it is mended.
settings.register_profile(
    "rtsim", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("rtsim")


@pytest.fixture(scope="module", autouse=True)
def leftovers_of_clusters(request: pytest.FixtureRequest) -> Iterator[None]:
    """Dask leaves sockets to the garbage collector, which would complain in the middle of somebody else's test."""
    yield
    if "cluster" in request.module.__name__ or "campaign" in request.module.__name__:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            gc.collect()
