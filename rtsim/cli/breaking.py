"""``rtsim break``: looks for the flight that breaks a law, makes it a scenario, says how likely such a flight is."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.choices import FalsificationMethod
from rtsim.cli.cluster import DaskAddress, DaskTls, cluster_of
from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, progress, results
from rtsim.errors import EXIT_EXPECTATION_FAILED, InputError
from rtsim.jsonable import to_jsonable
from rtsim.loop.options import CONDITION
from rtsim.whole_file import check_writable, write_whole

if TYPE_CHECKING:
    from scenarios.campaign.chunks import Task
    from scenarios.falsification.evaluation import Flyer
    from scenarios.falsification.run import BreakOptions, BreakResult, EstimateResult
    from scenarios.falsification.search import Progress


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("break")(break_command)


@takes_options("plant", "database", *CONDITION, "rate_hz", own="the campaign's")
def break_command(
    subject: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENARIO|CAMPAIGN]",
            help="What is varied: the classes of a campaign, or hands and air around a scenario.",
            show_default="the campaign misuse",
        ),
    ] = None,
    *,
    protection: Annotated[
        str | None, typer.Option(help="Law to break: a name or MODULE:CLASS.", show_default="the campaign's")
    ] = None,
    formulas: Annotated[
        list[str] | None,
        typer.Option(
            "--property",
            help="What must hold, in signal temporal logic; repeat for several.",
            show_default="the campaign's, else that the corridor is kept",
        ),
    ] = None,
    budget: Annotated[int, typer.Option(help="Flights of the search.", min=1, max=10_000_000)] = 1000,
    method: Annotated[FalsificationMethod, typer.Option(help="How to search.")] = "mixed",
    only: Annotated[
        list[str] | None, typer.Option("--class", help="Class that is searched; repeat.", show_default="all")
    ] = None,
    bandwidth_hz: Annotated[
        float, typer.Option(help="Fastest movements of hands around a scenario [Hz].", min=0.01, max=5.0)
    ] = 0.5,
    keep_on: Annotated[bool, typer.Option("--keep-on", help="Search on for the worst when all is broken.")] = False,
    no_compare: Annotated[bool, typer.Option("--no-compare", help="Fly no random flights for comparison.")] = False,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Estimate how likely it breaks, instead of searching.")
    ] = False,
    points: Annotated[
        int, typer.Option(help="Flights of each level and class of --estimate.", min=20, max=1_000_000)
    ] = 500,
    seed: Annotated[int, typer.Option(help="Root of every random stream.", min=0)] = 0,
    options: dict[str, Any],
    jobs: Annotated[int | None, typer.Option(help="Processes.", min=1, max=256, show_default="one per core")] = None,
    dask: DaskAddress = None,
    dask_tls: DaskTls = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for flights (the same command goes on there), scenario, pictures and report.json.",
            show_default="the scenario here, nothing else",
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Throw away what --out holds.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Search the flight that breaks a law; exit 1 where one is found. It is written as a scenario.

    Examples:
        rtsim break --protection governor  # the campaign misuse; the scenario and its picture are written here
        rtsim break turns --budget 3000 --out found  # the same command goes on after a stop
        rtsim break hover --property "always (altitude_m > 80)"  # hands and air around a scenario
        rtsim break turns --estimate  # how likely it breaks
    """
    if out is not None:
        check_writable(out, folder=True)
    elif fresh:
        raise InputError("needs a folder", key="--fresh", mend="add --out FOLDER")
    from rtsim.worker_pool import Workers
    from scenarios.falsification.flyers import DaskFlyer, LocalFlyer
    from scenarios.falsification.run import BreakOptions, break_task
    from scenarios.falsification.subject import subject_of

    asked = BreakOptions(
        law=protection,
        properties=tuple(formulas or ()),
        budget=budget,
        method=method,
        seed=seed,
        keep_on=keep_on,
        compare=not no_compare,
        classes=tuple(only or ()),
        changes=options,
        folder=out,
        fresh=fresh,
    )
    spec, text, file = subject_of(subject, bandwidth_hz=bandwidth_hz)
    task = break_task(spec, text, options=asked, file=file)
    goes_on = "the same command goes on" if out is not None else "with --out FOLDER it could go on later"
    count = jobs or os.cpu_count() or 1
    with cluster_of(dask, dask_tls, jobs, goes_on) as cluster, Workers(count) as workers:
        flyer: Flyer = LocalFlyer(task, workers, count) if cluster is None else DaskFlyer(task, cluster)
        if estimate:
            _estimate(task, flyer, asked, points, goes_on, json=json)
            return
        result = _search(task, flyer, asked, goes_on)
    files = _save(result, out)
    report = result.report(files)
    if out is not None:
        _write_report(report, out)
    if json:
        emit_json(report)
    else:
        _print(report)
    if result.found.stopped_by is not None:
        console.print(f"Stopped after {report['evaluations']} of {budget} flights; {goes_on}.")
        raise result.found.stopped_by
    if result.broken:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


def _search(task: Task, flyer: Flyer, asked: BreakOptions, goes_on: str) -> BreakResult:
    from scenarios.falsification.run import run_break

    with _watched(asked.budget, goes_on) as (told, shrinking):
        return run_break(task, flyer, asked, on_progress=told, on_shrink=shrinking)


@contextmanager
def _watched(budget: int, goes_on: str) -> Iterator[tuple[Callable[[str, Progress], None], Callable[[], None]]]:
    """Progress with the least robustness so far; on Ctrl-C before the first flights, how to go on."""
    current, shown, shrunk = "", 0, 0
    with progress("Searching", total=budget) as advance:

        def told(words: str, now: Progress) -> None:
            nonlocal current, shown
            if words != current:
                advance(-shown)  # the bar begins anew
                current, shown = words, 0
            least = ", ".join(f"{value:+.3g}" for value in now.least)
            advance(now.flights - shown, f"{words}: least robustness {least}")
            shown = now.flights

        def shrinking() -> None:
            nonlocal shrunk
            shrunk += 1
            advance(0.0, f"Shrinking: {shrunk} flights")

        try:
            yield told, shrinking
        except KeyboardInterrupt:
            console.print(f"Stopped; {goes_on}.")
            raise


def _save(result: BreakResult, out: Path | None) -> dict[str, str]:
    """Write the counterexamples, and with a folder what was flown; give the scenario file of each formula."""
    from scenarios.falsification.run import example_name

    files = {}
    for one in result.counterexamples:
        name = example_name(result.task, one.formula)
        path = _free(name) if out is None else out / f"{name}.toml"
        one.write(path, result.task.laws[0].name)
        files[one.formula] = str(path)
    if out is not None:
        result.coverage.draw(out / "coverage.png")
    return files


def _free(name: str) -> Path:
    """A scenario file that does not exist yet: nothing of the user's is written over."""
    names = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
    return next(path for one in names if not (path := Path(f"{one}.toml")).exists())


def _write_report(report: dict[str, Any], out: Path) -> None:
    import json

    write_whole(out / "report.json", json.dumps(to_jsonable(report), indent=1))


def _print(report: dict[str, Any]) -> None:
    """What was found, the most important first."""
    law = report["law"]
    for one in report["properties"]:
        unit = f" {one['unit']}" if one["unit"] else ""
        if one["broken"]:
            words = f"BROKEN by flight {one['first_broken']}: {one['robustness_min']:+.3g}{unit}"
        else:
            words = f"held in {report['evaluations']} flights; least robustness {one['robustness_min']:+.3g}{unit}"
        results.print(f"{law}: {words}: {one['formula']}", style="red" if one["broken"] else None)
    for one in report["counterexamples"]:
        results.print()
        results.print(one["sentence"])
        nonlinear = one["nonlinear_robustness"]
        seen = "cannot be flown there" if nonlinear is None else f"{nonlinear:+.3g} {one['unit']}"
        results.print(f"On the nonlinear aircraft: {seen}. Shrunk in {one['shrinking_flights']} flights.")
        results.print(f"Scenario: {one['scenario_file']}")
        results.print(f"  rtsim test {one['scenario_file']}     rtsim fly {one['scenario_file']}")
    random = report["random_search"]
    if random is not None:
        first = random["first_broken"]
        words = f"broke it with flight {first}" if first else f"least robustness {random['robustness_min']:+.3g}"
        results.print(f"Random flights, {random['evaluations']} of them: {words}.")
    problems = report["law_problems"]
    if problems["count"]:
        results.print(
            f"The law failed by itself in {problems['count']} flights: {problems['examples'][0]}", style="red"
        )
    coverage = report["coverage"]
    flown, cells = coverage["corridor_cells_flown"], coverage["corridor_cells"]
    results.print(f"Flown through {flown} of {cells} cells of the corridor; {report['wall_s']:.0f} s.")


def _estimate(task: Task, flyer: Flyer, asked: BreakOptions, points: int, goes_on: str, *, json: bool) -> None:
    from scenarios.falsification.run import run_estimate

    with _levels(goes_on) as told:
        found = run_estimate(task, flyer, asked, points=points, on_level=told)
    reports = [one.report() for one in found]
    report = {
        "campaign": task.file,
        "law": task.laws[0].label,
        "seed": task.seed,
        **{key: reports[0][key] for key in ("probability", "interval", "flights")},
        "estimates": reports,
    }
    if asked.folder is not None:
        _write_report(report, asked.folder)
    if json:
        emit_json(report)
    else:
        _print_estimates(task.laws[0].label, found)


@contextmanager
def _levels(goes_on: str) -> Iterator[Callable[[str, int, float], None]]:
    with console.real().status("Estimating") as status:

        def told(name: str, level: int, end: float) -> None:
            status.update(f"Estimating {name}: level {level} ends at robustness {end:+.3g}")

        try:
            yield told
        except KeyboardInterrupt:
            console.print(f"Stopped; {goes_on}.")
            raise


def _print_estimates(law: str, found: list[EstimateResult]) -> None:
    from rich.table import Table

    for one in found:
        report = one.report()
        low, high = report["interval"]
        results.print(f"{law} breaks: {one.formula}")
        results.print(f"  probability {report['probability']:.2g} [{low:.2g}, {high:.2g}], {report['flights']} flights")
        table = Table()
        for heading in ("class", "probability", "interval", "least robustness", "flights"):
            table.add_column(heading)
        for item in report["classes"]:
            low, high = item["interval"]
            table.add_row(
                item["name"],
                f"{item['probability']:.2g}",
                f"{low:.2g} to {high:.2g}",
                f"{item['robustness_min']:+.3g}",
                str(item["flights"]),
            )
        results.print(table)
