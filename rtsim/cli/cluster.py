"""The cluster of a command: ``--dask`` and ``--dask-tls``, declared and understood once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rtsim.errors import InputError

if TYPE_CHECKING:
    from rtsim.cluster.work import Cluster

DaskAddress = Annotated[
    str | None, typer.Option(help="Address of a Dask scheduler to fly on.", show_default="this machine")
]
DaskTls = Annotated[
    Path | None,
    typer.Option(help="File that names the certificates of an encrypted (tls://) scheduler.", show_default="none"),
]


@contextmanager
def cluster_of(dask: str | None, dask_tls: Path | None, jobs: int | None, goes_on: str) -> Iterator[Cluster | None]:
    """The cluster that a command was given; None: this machine.

    Args:
        dask: Address of the scheduler.
        dask_tls: File that names certificates.
        jobs: Processes or threads of this machine.
        goes_on: What to say of going on when the cluster is lost.
    """
    if dask is None:
        if dask_tls is not None:
            raise InputError("needs a scheduler", key="--dask-tls", mend="add --dask tls://HOST:PORT")
        yield None
        return
    if jobs is not None:
        raise InputError("has no meaning on a cluster", key="--jobs", value=jobs, mend="leave it out with --dask")
    from rtsim.cluster.work import Cluster

    with Cluster(dask, tls=dask_tls, goes_on=goes_on) as cluster:
        yield cluster
