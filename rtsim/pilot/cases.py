"""Pilot design problems as data: case files, results by name, comparison with expected values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rtsim.errors import InputError
from rtsim.pilot.design import MocmDesign
from rtsim.pilot.problem import MocmProblem, build_problem
from rtsim.toml_file import read_toml

DEFAULT_TOLERANCE: dict[str, float] = {
    "g": 1e-4, "T_n": 1e-6, "l_plant": 1e-4, "F_plant": 1e-3, "V_y": 1e-3, "V_u": 1e-3,
    "rms_y": 5e-4, "rms_delta": 5e-4, "rms_u_p": 5e-4, "rms_u_c": 5e-4, "rms_udot": 5e-4, "cost": 1e-3,
    "remnant_fraction": 1e-3, "freq": 1e-9, "Yp_re": 1e-3, "Yp_im": 1e-3,
    "w_c": 1e-3, "phase_margin": 2e-3, "gain_margin": 5e-3,
}  # fmt: skip
"""Tolerances relative to the largest entry of an array, where a file gives none."""

RESULT_KEYS = tuple(DEFAULT_TOLERANCE)
"""Every result of a design, by the name used in case files and in JSON."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One result beside the value a case file expects."""

    key: str
    """Name of the result."""
    error: float
    """Largest difference over the largest expected entry; infinite where sizes differ."""
    tolerance: float
    """What is allowed."""

    @property
    def held(self) -> bool:
        """Whether the result is within the tolerance."""
        return self.error <= self.tolerance


@dataclass(frozen=True, slots=True)
class Case:
    """One problem of a case file."""

    name: str
    """Its name in the file."""
    kind: Literal["case", "reject"]
    """Whether it must be solved or refused."""
    about: str
    """One sentence from the file."""
    fields: Mapping[str, Any]
    """The problem's fields, unchecked."""
    expect: Mapping[str, Any]
    """Expected results, possibly none."""
    published: Mapping[str, Any]
    """Numbers printed in a source, with ``tol`` and ``source``."""
    code: str | None
    """Code with which it must be refused."""

    def problem(self) -> MocmProblem:
        """Check the fields.

        Returns:
            The design problem.

        Raises:
            MocmError: A value is impossible.
        """
        return build_problem(self.fields)


@dataclass(frozen=True, slots=True)
class CaseFile:
    """All problems of a case file."""

    path: str
    """Where it was read."""
    cases: tuple[Case, ...]
    """Its problems in order."""
    tolerance: Mapping[str, float]
    """Tolerances of its expected values."""

    def find(self, name: str) -> Case:
        """Look a problem up.

        Args:
            name: Its name, optionally with ``case.`` or ``reject.`` before it.

        Returns:
            The problem.

        Raises:
            InputError: There is none of that name.
        """
        for case in self.cases:
            if name in (case.name, f"{case.kind}.{case.name}"):
                return case
        names = ", ".join(case.name for case in self.cases)
        raise InputError("has no case of this name", file=self.path, key="--case", value=name, allowed=names)


def _table(value: object, path: str, key: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError("is not a table", file=path, key=key, mend=f"write it as [{key}]")
    return value


def _case(table: Mapping[str, Any], *, name: str, kind: Literal["case", "reject"], path: str) -> Case:
    key = f"{kind}.{name}"
    if "input" not in table:
        raise InputError("has no input", file=path, key=key, mend=f"add the table [{key}.input]")
    fields = dict(_table(table["input"], path, f"{key}.input"))
    about = table.get("about", fields.pop("about", ""))
    code = table.get("code")
    return Case(
        name=name,
        kind=kind,
        about=str(about),
        fields=fields,
        expect=_table(table.get("expect", {}), path, f"{key}.expect"),
        published=_table(table.get("published", {}), path, f"{key}.published"),
        code=None if code is None else str(code),
    )


def load_cases(path: str | Path) -> CaseFile:
    """Read a case file: tables [case.NAME] and [reject.NAME], or one problem's fields at the top level.

    Args:
        path: A TOML file.

    Returns:
        Its problems, not yet checked.

    Raises:
        InputError: The file cannot be read or is not laid out as a case file.
    """
    return cases_of(read_toml(path, noun="case"), str(path))


def cases_of(document: Mapping[str, Any], shown: str) -> CaseFile:
    """Take the problems from the tables of a case file.

    Args:
        document: The tables.
        shown: How to call the file in messages.

    Raises:
        InputError: It is not laid out as a case file.
    """
    cases: list[Case] = []
    kinds: tuple[Literal["case", "reject"], ...] = ("case", "reject")
    for kind in kinds:
        for name, table in _table(document.get(kind, {}), shown, kind).items():
            cases.append(_case(_table(table, shown, f"{kind}.{name}"), name=name, kind=kind, path=shown))
    if not cases and "input" in document:
        cases.append(_case(document, name=Path(shown).stem, kind="case", path=shown))
    elif not cases and "A" in document:
        cases.append(_case({"input": document}, name=Path(shown).stem, kind="case", path=shown))
    if not cases:
        raise InputError(
            "holds no design problem", file=shown, mend="add [case.NAME.input] with A, B, C, E, q_y, tau_n"
        )
    tolerance = dict(DEFAULT_TOLERANCE)
    for key, value in _table(document.get("tolerance", {}), shown, "tolerance").items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value >= 0.0:
            raise InputError("is not a tolerance", file=shown, key=f"tolerance.{key}", value=value, allowed=">= 0")
        tolerance[key] = float(value)
    return CaseFile(path=shown, cases=tuple(cases), tolerance=tolerance)


def design_results(design: MocmDesign) -> dict[str, Any]:
    """All results of a design under the names of ``RESULT_KEYS``, as plain lists and numbers.

    Args:
        design: A solved pilot.

    Returns:
        Results; a crossover or margin that does not exist is NaN or infinite.
    """
    statistics, margins = design.statistics, design.margins()
    response = design.transfer_matrix(design.problem.freq)
    arrays = {
        "g": design.regulator.g,
        "T_n": design.regulator.T_n,
        "l_plant": design.l_plant,
        "F_plant": design.F_plant,
        "V_y": design.estimator.V_y,
        "V_u": design.estimator.V_u,
        "rms_y": statistics.rms_y,
        "rms_delta": statistics.rms_delta,
        "rms_u_p": statistics.rms_u_p,
        "rms_u_c": statistics.rms_u_c,
        "rms_udot": statistics.rms_udot,
        "cost": np.asarray(statistics.cost),
        "remnant_fraction": statistics.remnant_fraction,
        "freq": design.problem.freq,
        "Yp_re": response.real,
        "Yp_im": response.imag,
        "w_c": margins.w_c,
        "phase_margin": margins.phase_margin,
        "gain_margin": margins.gain_margin,
    }
    return {key: value.tolist() for key, value in arrays.items()}


def compare_results(
    results: Mapping[str, Any], expected: Mapping[str, Any], *, tolerance: Mapping[str, float] | float
) -> list[Comparison]:
    """Set results beside expected values.

    Args:
        results: Results of a design.
        expected: Expected values; keys that are no results (``source``, ``tol``) are passed over.
        tolerance: Allowed difference relative to the largest expected entry, by name or one for all.

    Returns:
        One comparison per expected value.
    """
    comparisons = []
    for key in RESULT_KEYS:
        if key not in expected:
            continue
        allowed = tolerance if isinstance(tolerance, float) else tolerance.get(key, DEFAULT_TOLERANCE[key])
        error = np.inf
        try:
            wanted, got = np.asarray(expected[key], dtype=np.float64), np.asarray(results[key], dtype=np.float64)
        except (TypeError, ValueError):
            wanted, got = np.zeros(1), np.zeros(0)
        if wanted.shape == got.shape:
            same = (wanted == got) | (np.isnan(wanted) & np.isnan(got))
            finite = wanted[np.isfinite(wanted)]
            largest = float(np.max(np.abs(finite))) if finite.size else 1.0
            with np.errstate(invalid="ignore"):
                difference = np.where(same, 0.0, np.abs(got - wanted))
            worst = float(np.max(difference, initial=0.0))
            error = worst / largest if largest > 0.0 else worst
        comparisons.append(Comparison(key=key, error=float(error) if np.isfinite(error) else np.inf, tolerance=allowed))
    return comparisons
