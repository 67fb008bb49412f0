"""matplotlib as it is shipped, whatever the user has set for it: a picture depends on what is drawn alone."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtsim.errors import InputError
from rtsim.whole_file import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")
"""Endings of pictures."""
BLUE, ORANGE, GREEN, PURPLE, GREY, RED = "#1f6fb4", "#d9730d", "#2a8c4a", "#8a3fa0", "#777777", "#c23b3b"
"""Colours of reports, which stay apart in print and for most colour-blind readers."""
REPORT_STYLE: dict[str, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "svg.fonttype": "path",
    "svg.hashsalt": "rtsim",
}
"""matplotlib settings of all figures of reports."""


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


def save_both(figure: Figure, directory: Path, stem: str) -> dict[str, Path]:
    """Write a figure of a report as SVG and PNG, the same bytes for the same figure.

    Args:
        figure: The figure.
        directory: Where; pictures of the same name are replaced.
        stem: File name without ending.

    Returns:
        The files by format.

    Raises:
        OutputError: A picture cannot be written.
    """
    files = {}
    for suffix, metadata in (("svg", {"Date": None}), ("png", {"Software": None})):
        path = directory / f"{stem}.{suffix}"
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=150, format=suffix, metadata=metadata)
        files[suffix] = path
    return files


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
