"""The whole of ``rtsim reproduce``: fly, judge, draw and write the report."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rtsim
from rtsim.errors import InputError, OutputError
from rtsim.whole_file import write_whole
from scenarios.reproduction.claims import Claim
from scenarios.reproduction.drawing import save_figures
from scenarios.reproduction.figures import FIGURES
from scenarios.reproduction.report import report_html
from scenarios.reproduction.study import run_study, work_amount

REPORT_NAME, CLAIMS_NAME = "report.html", "claims.json"


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What was judged and written."""

    claims: tuple[Claim, ...]
    """The claims, in the paper's order."""
    report: Path
    """The HTML report."""
    figures: tuple[Path, ...]
    """All pictures."""


def reproduce(
    out: Path, *, jobs: int = 1, progress: Callable[[float, str], None] | None = None, database: str = ""
) -> Reproduction:
    """Regenerate the paper's figures and judge its claims.

    Args:
        out: Directory for the report (``report.html``), the claims (``claims.json``) and the figures; made if needed.
        jobs: Processes to use; the result does not depend on it.
        progress: Called with the work done since the last call and what is done now; it adds up to :func:`total_work`.
        database: LPV database that is flown, a file; empty: the shipped XV-15.

    Returns:
        What was judged and written.

    Raises:
        InputError: ``out`` is a file, or the database cannot be used.
        OutputError: A file cannot be written.
    """
    advance = progress if progress is not None else lambda *_: None
    if out.exists() and not out.is_dir():
        raise InputError("is a file", key="--out", value=str(out), mend="name a directory")
    try:
        (out / "figures").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{out}: cannot be made ({error.strerror or error}); choose another directory.") from error
    study = run_study(jobs=jobs, progress=advance, database=database)
    files = save_figures(study, FIGURES, out / "figures", drawn=advance)
    text = report_html(study, FIGURES, files, version=rtsim.__version__)
    write_whole(out / REPORT_NAME, text)
    entries = {"claims": [claim.to_json() for claim in study.claims], "database_sha256": study.database_hash}
    content = json.dumps(entries, indent=1, ensure_ascii=False) + "\n"
    write_whole(out / CLAIMS_NAME, content)
    return Reproduction(study.claims, out / REPORT_NAME, tuple(path for pair in files.values() for path in pair))


def total_work() -> int:
    """Amount of work, in the unit of the progress."""
    return work_amount() + len(FIGURES)
