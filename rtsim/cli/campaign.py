"""``rtsim campaign``: flies thousands of drawn flights with a law and without, and gives a verdict with bounds."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.cluster import DaskAddress, DaskTls, cluster_of
from rtsim.cli.completion import campaign_names
from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, progress, results
from rtsim.errors import EXIT_EXPECTATION_FAILED, InputError, OutputError
from rtsim.jsonable import to_jsonable
from rtsim.loop.options import CONDITION
from rtsim.whole_file import check_writable, whole_file, write_whole

if TYPE_CHECKING:
    from scenarios.campaign.run import CampaignResult


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("campaign")(run_campaign_command)


@takes_options("plant", "database", *CONDITION, "rate_hz", own="the file's")
def run_campaign_command(
    spec: Annotated[
        str,
        typer.Argument(
            help="Campaign that comes with rtsim (misuse, nominal) or a .toml file.",
            autocompletion=campaign_names,
        ),
    ],
    *,
    runs: Annotated[int | None, typer.Option(help="Runs of every class.", min=1, show_default="the file's")] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes.", min=1, max=256, show_default="one per core")] = None,
    seed: Annotated[int, typer.Option(help="Seed of every draw.", min=0)] = 0,
    protection: Annotated[
        str | None, typer.Option(help="Law under test: a name or MODULE:CLASS.", show_default="the file's")
    ] = None,
    against: Annotated[
        list[str] | None,
        typer.Option(help="Law to compare it with on the same flights; repeat for several.", show_default="the file's"),
    ] = None,
    sweep_buffer_kt: Annotated[
        list[float] | None,
        typer.Option(help="Fly the law with this much added to its margins [kn] too; repeat.", show_default="none"),
    ] = None,
    options: dict[str, Any],
    no_early_stop: Annotated[
        bool, typer.Option("--no-early-stop", help="Fly everything, though the verdict may be certain before.")
    ] = False,
    dask: DaskAddress = None,
    dask_tls: DaskTls = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for finished flights (the same command goes on there), report.json and flights.csv.",
            show_default="none",
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Throw away what --out holds.")] = False,
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML here.", show_default="none")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Fly a campaign: drawn flights, each with every law and without; exit 1 where an expectation does not hold.

    Examples:
        rtsim campaign nominal --runs 200  # drawn flights that the law must leave alone
        rtsim campaign misuse --out misuse --against governor  # the same command goes on after a stop
    """
    for file, folder in ((out, True), (junit, False)):
        if file is not None:
            check_writable(file, folder=folder)
    from scenarios.campaign.chunks import plan_chunks
    from scenarios.campaign.executors import DaskExecutor, LocalExecutor
    from scenarios.campaign.run import CampaignOptions, run_campaign
    from scenarios.campaign.spec import load_campaign

    if fresh and out is None:
        raise InputError("needs a folder", key="--fresh", mend="add --out FOLDER")
    if junit is not None and not junit.absolute().parent.is_dir():
        raise OutputError(f"{junit}: cannot be written: its folder does not exist.")
    campaign, text = load_campaign(spec)
    asked = CampaignOptions(
        law=protection,
        against=None if against is None else tuple(against),
        buffers_kt=tuple(sweep_buffer_kt or ()),
        runs=runs,
        seed=seed,
        changes=options,
        early_stop=not no_early_stop,
        folder=out,
        fresh=fresh,
    )
    planned = sum(chunk.count for chunk in plan_chunks(campaign, runs))
    goes_on = "the same command goes on" if out is not None else "with --out FOLDER it could go on later"
    with cluster_of(dask, dask_tls, jobs, goes_on) as cluster, _watched(campaign.name, planned, goes_on) as watch:
        executor = LocalExecutor(jobs or os.cpu_count() or 1) if cluster is None else DaskExecutor(cluster)
        result = run_campaign(campaign, text, options=asked, executor=executor, file=str(spec), on_progress=watch)
    report = result.report()
    if out is not None:
        _save(result, report, out)
    if junit is not None:
        _write_junit(result, junit)
    if json:
        emit_json(report)
    else:
        _print(report)
    if not result.held:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


@contextmanager
def _watched(name: str, planned: int, goes_on: str) -> Iterator[Callable[[int, int], None]]:
    """Progress as runs end; on Ctrl-C, how to go on."""
    shown = 0
    with progress(f"Flying the campaign {name}", total=planned) as advance:

        def watch(done: int, of: int) -> None:
            nonlocal shown
            del of
            advance(done - shown)
            shown = done

        try:
            yield watch
        except KeyboardInterrupt:
            console.print(f"Stopped after {shown} of {planned} runs; {goes_on}.")
            raise


def _save(result: CampaignResult, report: dict[str, Any], folder: Path) -> None:
    """Write the report, and every flight with its metrics."""
    import json

    from rtsim.measures.metrics import TRIAL_METRICS, TrialMetrics

    write_whole(folder / "report.json", json.dumps(to_jsonable(report), indent=1))
    with (
        whole_file(folder / "flights.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as stream,
    ):
        table = csv.writer(stream)
        table.writerow(["class", "run", "law", *TRIAL_METRICS])
        for item, metrics in zip(result.spec.classes, result.flights.metrics, strict=True):
            for run, laws in enumerate(metrics):
                for law, values in zip(result.task.laws, laws, strict=True):
                    table.writerow(
                        [item.name, run, law.label, *(f"{value:.9g}" for value in TrialMetrics(values).values())]
                    )


def _write_junit(result: CampaignResult, path: Path) -> None:
    """One testcase for each expectation, and one that the law under test runs."""
    from scenarios.verdicts.junit import JunitCase, junit_xml

    law = result.task.laws[0].label
    suite = f"rtsim.campaign.{result.spec.name}.{law}"
    broken = [words for _, _, name, words in result.problems if name == law]
    cases = [
        JunitCase(
            name=item.name,
            suite=suite,
            seconds=0.0,
            properties={
                "event": item.event,
                "law": item.law,
                "seed": result.task.seed,
                "plant": result.task.options.plant,
                "count": item.rate.count,
                "flights": item.rate.total,
                "rate": item.rate.value,
                "upper_bound": item.rate.upper,
            },
            failures=() if item.held else (item.sentence,),
        )
        for item in result.judged
    ]
    error = f"{broken[0]} ({len(broken)} in all)" if broken else ""
    cases.append(JunitCase(name="the law runs without failing", suite=suite, seconds=result.wall_s, error=error))
    write_whole(path, junit_xml("rtsim campaign", cases))


def _print(report: dict[str, Any]) -> None:
    """Laws, classes, expectations and what went wrong, for people."""
    from rich.table import Table

    laws = Table(
        title=f"{report['campaign']}: {report['runs']} of {report['runs_planned']} runs, seed {report['seed']}"
    )
    for heading in (
        "law",
        "left the corridor",
        "by > 5 kn",
        "depth p50 / p95 [kn]",
        "nuisance",
        "harm",
        "height lost max [m]",
    ):
        laws.add_column(heading)
    for item in report["laws"]:
        events = item["events"]
        laws.add_row(
            item["law"],
            *(_share(events[name]) for name in ("exceeded", "deep")),
            f"{_spread(item['depth_kt']['p50'])} / {_spread(item['depth_kt']['p95'])}",
            *(_share(events[name]) for name in ("nuisance", "harmed")),
            f"{item['height_lost_m']['max']:.1f}",
        )
    results.print(laws)
    by_class = Table(title="left the corridor, by class")
    for heading in ("class", "runs", *(item["law"] for item in report["laws"])):
        by_class.add_column(heading)
    for item in report["classes"]:
        found = (f"{item['laws'][law['law']]['exceeded']['value']:.1%}" for law in report["laws"])
        by_class.add_row(item["name"], str(item["runs"]), *found)
    results.print(by_class)
    _print_comparisons(report)
    for item in report["expectations"]:
        word = "held  " if item["held"] else "FAILED"
        results.print(
            f"{word} {item['name']}: {item['event']} of {item['law']} {item['count']} of {item['total']}, "
            f"upper bound {item['upper_bound']:.3g}, want {item['limit']}",
            style=None if item["held"] else "red",
        )
    problems = report["law_problems"]
    if problems["count"]:
        results.print(f"laws failed in {problems['flights']} flights:", style="red")
        for item in problems["examples"]:
            results.print(f"  {item['law']} in {item['class']} run {item['run']}: {item['text']}", markup=False)
    if report["stopped_early"]:
        results.print("Ended early: more flights could not have changed the verdict.")
    results.print(f"{report['flights']} flights in {report['wall_s']:.1f} s")


def _print_comparisons(report: dict[str, Any]) -> None:
    for item in report["comparisons"]:
        if item["event"] == "exceeded":
            results.print(
                f"{item['law']} against {item['against']}: left the corridor where the other did not in "
                f"{item['only_first']} flights, the other way round in {item['only_second']} "
                f"(McNemar, p = {item['p_value']:.2g})"
            )
    if report["operating_characteristic"]:
        from rich.table import Table

        table = Table(title="operating characteristic")
        for heading in ("buffer [kn]", "nuisance (nominal)", "left the corridor (misuse)"):
            table.add_column(heading)
        for item in report["operating_characteristic"]:
            table.add_row(f"{item['buffer_kt']:+g}", _share(item["nuisance"]), _share(item["exceeded"]))
        results.print(table)


def _share(rate: dict[str, Any]) -> str:
    if not rate["total"]:
        return "none flown"
    return f"{rate['value']:.1%} [{rate['low']:.1%}, {rate['high']:.1%}]"


def _spread(quantile: dict[str, Any]) -> str:
    value = quantile["value"]
    return f"{value:.1f} [{quantile['low']:.1f}, {quantile['high']:.1f}]" if math.isfinite(value) else "-"
