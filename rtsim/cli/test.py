"""``rtsim test``: flies scenarios as tests and gives a verdict that CI can read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.completion import scenario_names
from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, progress, results
from rtsim.errors import EXIT_EXPECTATION_FAILED, InputError, RtsimError
from rtsim.loop.options import CONDITION
from rtsim.whole_file import check_writable, write_whole

if TYPE_CHECKING:
    from scenarios.files.scenario import Scenario
    from scenarios.verdicts.tester import Case


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("test")(run_tests)


@takes_options("plant", "database", *CONDITION, "rate_hz", own="each scenario's")
def run_tests(
    paths: Annotated[
        list[str] | None,
        typer.Argument(
            help="Scenario names, .toml files or folders of them.",
            show_default="the whole library",
            autocompletion=scenario_names,
        ),
    ] = None,
    *,
    protection: Annotated[
        str | None,
        typer.Option(help="Law under test: a name or MODULE:CLASS.", show_default="each scenario's, full in a trial"),
    ] = None,
    options: dict[str, Any],
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML here.", show_default="none")] = None,
    html: Annotated[Path | None, typer.Option(help="Write a report with pictures here.", show_default="none")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for a replay bundle of every failure.", show_default="none")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Fly scenarios as tests: with a protection law and, with the same seed, without; exit 1 where one fails.

    Examples:
        rtsim test ep21_steep_turn  # one flight, with a verdict
        rtsim test tests/flights --junit results.xml --out failures  # a folder of them, for CI
        rtsim test --plant nonlinear --html report.html  # the library on the nonlinear model
    """
    for file, folder in ((junit, False), (html, False), (out, True)):
        if file is not None:
            check_writable(file, folder=folder)
    scenarios = _chosen(paths or [])
    if out is not None:
        from scenarios.verdicts.bundle import check_bundle

        for scenario in scenarios:
            check_bundle(scenario.name, out)
    cases = _flown(scenarios, protection, options)
    if junit is not None:
        _write_junit(cases, junit)
    if html is not None:
        from scenarios.verdicts.html_report import html_report

        write_whole(html, html_report(cases))
    bundles = _bundles(cases, out)
    failed = sum(case.verdict != "passed" for case in cases)
    if json:
        emit_json(
            {
                "scenarios": len(cases),
                "passed": len(cases) - failed,
                "failed": failed,
                "cases": [case.summary() | {"bundle": bundles.get(case.name)} for case in cases],
            }
        )
    else:
        _print(cases)
    if failed:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


def _chosen(paths: list[str]) -> list[Scenario]:
    """Load what is to be tested, before anything is flown."""
    from scenarios.files.loader import library_names, load_scenario
    from scenarios.verdicts.tester import is_test

    names: list[str | Path] = []
    for path in paths:
        folder = Path(path)
        if folder.is_dir():
            found = sorted(folder.glob("*.toml"))
            if not found:
                raise InputError("holds no scenario files", file=path, mend="name a folder with .toml files")
            names += found
        else:
            names.append(path)
    loaded = [load_scenario(name) for name in (names or library_names())]
    tests = [scenario for scenario in loaded if is_test(scenario)]
    if paths and len(tests) < len(loaded):
        odd = next(scenario for scenario in loaded if not is_test(scenario))
        raise InputError(
            "says nothing that could be tested",
            file=odd.file,
            mend="add [[expect]] or [trial] (docs/testing-protection.md)",
        )
    return tests


def _flown(scenarios: list[Scenario], protection: str | None, options: dict[str, Any]) -> list[Case]:
    from scenarios.flight.preflight import preflight_problems
    from scenarios.verdicts.tester import Tester, broken_case

    tester = Tester(law=protection, **options)
    for scenario in scenarios:
        for problem in preflight_problems(scenario.with_options(**options)):
            raise problem
    cases = []
    with progress("Testing", total=len(scenarios)) as advance:
        for scenario in scenarios:
            advance(0, f"Testing {scenario.name}")
            try:
                cases.append(tester.run(scenario))
            except RtsimError as error:
                cases.append(broken_case(scenario, protection, str(error)))
            advance(1)
    return cases


def _write_junit(cases: list[Case], path: Path) -> None:
    from scenarios.verdicts.junit import JunitCase, junit_xml
    from scenarios.verdicts.tester import LAW_CLAUSE

    document = junit_xml(
        "rtsim test",
        [
            JunitCase(
                name=case.name,
                suite=f"rtsim.test.{case.law}",
                seconds=case.wall_s,
                properties={
                    "law": case.law,
                    "kind": case.kind,
                    "plant": case.scenario.options.plant,
                    "corridor": case.scenario.options.corridor_name,
                    "seed": case.scenario.options.seed,
                    **case.metrics,
                    **{f"off.{name}": value for name, value in case.off_metrics.items()},
                },
                failures=[item.sentence for item in case.failures if item.metric != LAW_CLAUSE],
                error=case.error or case.law_failure,
            )
            for case in cases
        ],
    )
    write_whole(path, document)


def _bundles(cases: list[Case], out: Path | None) -> dict[str, str]:
    if out is None:
        return {}
    from scenarios.verdicts.bundle import write_bundle

    found = {}
    for case in cases:
        if case.verdict == "failed":
            found[case.name] = str(write_bundle(case, out))
            console.print(f"{case.name}: bundle in {found[case.name]}")
    return found


def _print(cases: list[Case]) -> None:
    from rich.table import Table
    from rich.text import Text

    # No frame, and a law that all have in common said once: rows fit 80 columns and the lines of a pipe.
    laws = {case.law for case in cases}
    if len(laws) == 1:
        results.print(f"law under test: {cases[0].law}", markup=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("scenario", no_wrap=True)
    table.add_column("kind", no_wrap=True)
    if len(laws) > 1:
        table.add_column("law", overflow="ellipsis", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for heading in ("kn out", "off"):
        table.add_column(heading, justify="right", no_wrap=True)
    for case in cases:
        table.add_row(
            case.name,
            case.kind,
            *([case.law] if len(laws) > 1 else []),
            Text(
                *{"passed": ("passed", "green"), "failed": ("FAILED", "red"), "error": ("ERROR", "red")}[case.verdict]
            ),
            *(f"{values['depth_kt']:.1f}" if values else "" for values in (case.metrics, case.off_metrics)),
        )
    results.print(table)
    results.print("kn out: outside the corridor at the deepest, with the law; off: without it", soft_wrap=True)
    for case in cases:
        words = [case.error] if case.error else [f"{item.name}: {item.sentence}" for item in case.failures]
        words += [case.note] if case.note else []
        for word in words:
            # Whole lines: whoever reads a pipe looks for them, and terminals wrap by themselves.
            results.print(f"{case.name}: {word}", markup=False, soft_wrap=True)
    failed = sum(case.verdict != "passed" for case in cases)
    results.print(f"{len(cases) - failed} of {len(cases)} passed")
