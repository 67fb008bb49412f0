"""The whole of ``rtsim validate``: run, draw, write."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtsim.errors import InputError, OutputError
from rtsim.validation.bench import the_bench
from rtsim.validation.contradictions import Contradiction, contradictions
from rtsim.validation.declared import GROUPS
from rtsim.validation.document import document
from rtsim.validation.markup import markdown, page
from rtsim.validation.plots import FIGURES, draw_figures
from rtsim.validation.run import Progress, Validation, validate
from rtsim.validation.sensitivity import UNCERTAIN, Sensitivity, pieces_of, sensitivity
from rtsim.whole_file import write_whole

JSON_NAME, PAGE_NAME, MARKDOWN_NAME = "validation.json", "validation.html", "validation.md"


@dataclass(frozen=True, slots=True)
class Report:
    """What was found and written."""

    validation: Validation
    """The checks."""
    contradictions: tuple[Contradiction, ...]
    """Sources side by side."""
    sensitivity: Sensitivity | None
    """How far inputs move the checks; None: not asked for."""
    page: Path
    """The HTML report."""
    pictures: tuple[Path, ...]
    """The plots."""

    def to_json(self) -> dict[str, Any]:
        """The content of ``validation.json``."""
        found: dict[str, Any] = {
            "checks": [result.to_json() for result in self.validation.results],
            "counts": self.validation.counts(),
            "contradictions": [one.to_json() for one in self.contradictions],
        }
        if self.sensitivity is not None:
            found["sensitivity"] = self.sensitivity.to_json()
        return found


def total_work(*, sensitivity: bool = False) -> float:
    """Amount of work, in the unit of the progress.

    Args:
        sensitivity: Whether inputs are moved too.
    """
    return len(GROUPS) + 2 + (len(pieces_of(UNCERTAIN)) if sensitivity else 0)


def write_report(
    out: Path, *, sensitivity: bool = False, jobs: int = 1, progress: Progress | None = None
) -> Report:  # fmt: skip
    """Run every check, draw the plots and write the report.

    Args:
        out: Directory; made if needed.
        sensitivity: Also move every uncertain input to both ends of its range.
        jobs: Processes; the result does not depend on it.
        progress: Told what is done; adds up to :func:`total_work`.

    Raises:
        InputError: ``out`` is a file.
        OutputError: A file cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise InputError("is a file", key="--out", value=str(out), mend="name a directory")
    try:
        (out / "figures").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{out}: cannot be made ({error.strerror or error}); choose another directory.") from error
    tell = progress if progress is not None else _silent
    found = validate(jobs=jobs, progress=tell)
    tell(0.0, "Sources side by side")
    beside = contradictions(the_bench())
    moved = _sensitivity(found, jobs=jobs, progress=tell) if sensitivity else None
    tell(1.0, "Drawing")
    pictures = draw_figures(found, out / "figures")
    blocks = document(found, beside, moved)
    drawn = {figure.stem: pictures[figure.stem]["svg"] for figure in FIGURES}
    write_whole(out / MARKDOWN_NAME, markdown(blocks))
    write_whole(out / PAGE_NAME, page(blocks, drawn, title="rtsim: validation of the XV-15"))
    report = Report(found, beside, moved, out / PAGE_NAME, tuple(_files(pictures)))
    write_whole(out / JSON_NAME, json.dumps(report.to_json(), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    tell(1.0, "Done")
    return report


_sensitivity = sensitivity
"""The function, beside the argument of that name."""


def _files(pictures: dict[str, dict[str, Path]]) -> Iterable[Path]:
    for formats in pictures.values():
        yield from formats.values()


def _silent(_: float, __: str) -> None:
    pass
