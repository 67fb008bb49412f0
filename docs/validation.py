"""Writes docs/validation.md, its figures and the list of known misses that the tests hold the model to.

After a change of the aircraft, of a check or of the published data (four minutes on two cores):

    python -m docs.validation
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rtsim.validation.report import write_report

if TYPE_CHECKING:
    from rtsim.validation.run import Validation

DOCS = Path(__file__).parent
PAGE, FIGURES = DOCS / "validation.md", DOCS / "figures"
KNOWN_MISSES = DOCS.parent / "tests" / "data" / "known_misses.toml"


def known_misses(validation: Validation) -> str:
    """The checks that miss, with the model's number, as TOML.

    Args:
        validation: The results.
    """
    lines = [
        "# Written by python -m docs.validation: the checks that miss, with the model's number, which the tests hold.",
        '# "none": the model has no such condition. Reasons: docs/validation.md.',
    ]
    for result in validation.results:
        if result.status == "misses":
            value = '"none"' if math.isnan(result.value) else repr(result.value)
            lines.append(f'"{result.check.id}" = {value}')
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write everything."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        report = write_report(out, sensitivity=True, jobs=os.cpu_count() or 1, progress=_tell)
        shutil.copyfile(out / "validation.md", PAGE)
        for picture in (out / "figures").glob("*.png"):
            shutil.copyfile(picture, FIGURES / picture.name)
    KNOWN_MISSES.write_text(known_misses(report.validation), encoding="utf-8")


def _tell(_: float, words: str) -> None:
    sys.stderr.write(f"\r{words:<60}")


if __name__ == "__main__":
    main()
    sys.stderr.write("\n")
