"""``rtsim pilot design``: solve pilot-model problems given as data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.help_text import App
from rtsim.cli.output import console, emit_json, results
from rtsim.errors import EXIT_BAD_INPUT, EXIT_EXPECTATION_FAILED, InputError

if TYPE_CHECKING:
    from rtsim.pilot.cases import Case, CaseFile, Comparison


def register(app: typer.Typer) -> None:
    """Add the command group to the app."""
    group = App(help="Design the virtual pilot (Modified Optimal Control Model).")
    group.callback()(_group)
    group.command("design")(design_command)
    app.add_typer(group, name="pilot")


def _group() -> None:
    """Design the virtual pilot (Modified Optimal Control Model)."""


def design_command(
    file: Annotated[Path, typer.Argument(help="TOML file with [case.NAME.input] tables (docs/pilot.md).")],
    *,
    case: Annotated[str | None, typer.Option(help="Solve only this case.", show_default="all of them")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Solve pilot-model problems: gains, noise, RMS, margins.

    Without --case every case of the file is solved, its rejects must be refused with their code, and values
    under [case.NAME.expect] are compared.

    Examples:
        rtsim pilot design cases.toml --case ks2
    """
    from rtsim.pilot.cases import load_cases

    cases = load_cases(file)
    if case is not None:
        _one(cases, cases.find(case), json=json)
        return
    outcome: dict[str, Any] = {"file": cases.path, "cases": {}, "rejects": {}}
    refused = failed = False
    for item in cases.cases:
        answer, error, comparisons = _solve(cases, item)
        outcome["cases" if item.kind == "case" else "rejects"][item.name] = answer
        held = _held(item, answer, comparisons)
        failed |= not held
        refused |= error is not None and item.kind == "case"
        if not json:
            _show(item, answer, comparisons, held=held)
        if error is not None and item.kind == "case":
            console.print(f"refused: {error}", markup=False)
    outcome["held"] = not failed
    if json:
        emit_json(outcome)
    if refused or failed:
        raise typer.Exit(EXIT_BAD_INPUT if refused else EXIT_EXPECTATION_FAILED)


def _one(cases: CaseFile, item: Case, *, json: bool) -> None:
    """Solve the one case that was asked for."""
    answer, error, comparisons = _solve(cases, item)
    held = _held(item, answer, comparisons)
    if json:
        emit_json({"case": item.name} | answer)
    else:
        _show(item, answer, comparisons, held=held)
    if error is not None:
        raise error
    if not held:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


def _solve(cases: CaseFile, item: Case) -> tuple[dict[str, Any], InputError | None, list[Comparison]]:
    """Solve a case: its results or its refusal, and the comparison with what the file expects."""
    from rtsim.pilot.cases import compare_results, design_results
    from rtsim.pilot.design import design_problem
    from rtsim.pilot.problem import MocmError

    try:
        answer = design_results(design_problem(item.problem()))
    except MocmError as error:
        located = error.located(file=cases.path, table=f"{item.kind}.{item.name}.input")
        return {"code": error.code, "message": str(located)}, located, []
    except InputError as error:
        key = f"{item.kind}.{item.name}.input.{error.key}"
        raise InputError(error.problem, file=cases.path, key=key, allowed=error.allowed) from error
    comparisons = compare_results(answer, item.expect, tolerance=cases.tolerance)
    published = compare_results(answer, item.published, tolerance=float(item.published.get("tol", 0.05)))
    return answer, None, comparisons + published


def _held(item: Case, answer: dict[str, Any], comparisons: list[Comparison]) -> bool:
    """Whether a case did what its file says."""
    if item.kind == "reject":
        return "code" in answer and item.code in (None, answer["code"])
    return "code" not in answer and all(comparison.held for comparison in comparisons)


_SHOWN = (
    ("g", "control-rate weight g"),
    ("T_n", "neuromotor lag T_n [s]"),
    ("l_plant", "gain l on the plant's states"),
    ("F_plant", "filter gain F of the plant's states"),
    ("V_y", "observation noise V_y"),
    ("V_u", "motor noise V_u"),
    ("rms_y", "RMS of displays"),
    ("rms_delta", "RMS of controls"),
    ("rms_u_c", "RMS of commanded controls"),
    ("rms_udot", "RMS of control rates"),
    ("cost", "cost"),
    ("remnant_fraction", "share of remnant"),
    ("w_c", "crossover [rad/s]"),
    ("phase_margin", "phase margin [deg]"),
    ("gain_margin", "gain margin [dB]"),
)


def _show(item: Case, answer: dict[str, Any], comparisons: list[Comparison], *, held: bool) -> None:
    """Print one case for people."""
    results.print(f"{item.kind} {item.name}" + (f": {item.about}" if item.about else ""), style="bold", markup=False)
    if "code" in answer:
        wanted = "" if item.code in (None, answer["code"]) else f", expected {item.code}"
        results.print(f"  refused: {answer['code']}{wanted}", markup=False)
        return
    for key, label in _SHOWN:
        results.print(f"  {label:<36} {_text(answer[key])}", markup=False, soft_wrap=True)
    if item.kind == "reject":
        results.print(f"  SOLVED, but the file says it must be refused ({item.code})", markup=False)
    if comparisons:
        worst = max(comparisons, key=lambda comparison: comparison.error / max(comparison.tolerance, 1e-300))
        verdict = "held" if held else "NOT HELD"
        nearest = f"{worst.key} {worst.error:.1e} of {worst.tolerance:.1e}"
        results.print(f"  expected values: {verdict}; nearest to its tolerance: {nearest}", markup=False)


def _text(value: Any) -> str:
    """Numbers with five digits, matrices row by row."""
    if isinstance(value, list):
        if value and isinstance(value[0], list):
            return "; ".join(_text(row) for row in value)
        return " ".join(_text(number) for number in value)
    return f"{value:.5g}"
