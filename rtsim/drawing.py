"""matplotlib as it is shipped, whatever the user has set for it: a picture depends on what is drawn alone."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rtsim.errors import InputError

FORMATS = (".png", ".svg", ".pdf")
"""Endings of pictures."""


def check_picture(path: Path, key: str) -> None:
    """Refuse a picture of no kind that can be drawn, before there is anything to draw.

    Args:
        path: The picture.
        key: The option that names it.

    Raises:
        InputError: Its ending says no format.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError("unknown picture format", key=key, value=str(path), allowed=", ".join(FORMATS))


@contextlib.contextmanager
def drawing(**settings: Any) -> Iterator[None]:
    """Draw with the shipped settings and these.

    Args:
        **settings: What differs from them, by matplotlib's names.
    """
    if "matplotlib" not in sys.modules:
        _load()
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        values: Any = settings  # its type lists the names
        mpl.rcParams.update(values)
        yield


def _load() -> None:
    """Import it past a settings file of the user, which may be damaged, and a backend that may not exist."""
    found = find_spec("matplotlib")
    assert found is not None
    assert found.origin is not None
    folder = Path(found.origin).parent
    os.environ.update(MPLBACKEND="agg", MATPLOTLIBRC=str(folder / "mpl-data" / "matplotlibrc"))
    # A file in the current folder would come first.
    with contextlib.chdir(folder) if Path("matplotlibrc").exists() else contextlib.nullcontext():
        import matplotlib as mpl  # noqa: F401
