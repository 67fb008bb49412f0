"""Reads a NetCDF file once in a process of its own, where it may hang, crash or eat memory; see ``netcdf.py``.

A script: it runs without the rest of rtsim.
"""

from __future__ import annotations

import resource
import sys

CPU_SECONDS = 5
"""A file of half a gigabyte takes three."""
MEMORY_BYTES = 8_000_000_000
"""Address space, most of which is the libraries'."""


def read_everything(path: str) -> None:
    """Open a file as its reader does, and read all that it holds.

    Args:
        path: The file.
    """
    import netCDF4

    with netCDF4.Dataset(path, "r") as dataset:
        dataset.set_auto_mask(False)
        groups = [dataset, *(dataset.groups["pilot"].groups.values() if "pilot" in dataset.groups else ())]
        for group in groups:
            for holder in (group, *group.variables.values()):
                for name in holder.ncattrs():
                    holder.getncattr(name)
            for variable in group.variables.values():
                if variable.size <= MEMORY_BYTES // 64:  # larger ones are refused by their reader
                    variable[...]


if __name__ == "__main__":
    for limit, value in (
        (resource.RLIMIT_CPU, CPU_SECONDS),
        (resource.RLIMIT_AS, MEMORY_BYTES),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(limit)[1]  # no process may raise its own
        allowed = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(limit, (allowed, hard))
    read_everything(sys.argv[1])
