"""``rtsim optimize``: searches the best conversion path, with progress, Ctrl-C, resume and a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.cluster import DaskAddress, DaskTls, cluster_of
from rtsim.cli.options import takes_options
from rtsim.cli.output import console, emit_json, results, working
from rtsim.errors import InputError
from rtsim.loop.options import CONDITION, declared
from rtsim.whole_file import check_writable, write_whole

if TYPE_CHECKING:
    from rtsim.cluster.work import Cluster
    from rtsim.optimization.path import ConversionPath
    from rtsim.optimization.problem import ConversionProblem
    from rtsim.optimization.search import Progress, SearchResult
    from rtsim.optimization.spec import SearchSpec

_OWN = "the specification's"


def _own(default: str) -> str:
    return f"{_OWN}, else {default}"


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("optimize")(optimize_command)


@takes_options("database", *CONDITION, own=_OWN)
def optimize_command(
    spec: Annotated[
        Path | None, typer.Argument(help="Specification (TOML).", show_default="the paper's search")
    ] = None,
    *,
    objective: Annotated[
        list[str] | None,
        typer.Option(
            help="What to minimize; repeat for a Pareto front (with --method nsga2).",
            show_default=_own("flapping_integral"),
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            help="Constraint set of a path of the paper: typical, near_stall, centre_line, ...", show_default="none"
        ),
    ] = None,
    generations: Annotated[int | None, typer.Option(help="Generations to search.", show_default=_own("40"))] = None,
    population: Annotated[int | None, typer.Option(help="Candidates per generation.", show_default=_own("32"))] = None,
    seed: Annotated[
        int | None, typer.Option(help="Root of the search's random stream.", show_default=_own("0"))
    ] = None,
    method: Annotated[str | None, typer.Option(help="cma-es, ga or nsga2.", show_default=_own("cma-es"))] = None,
    handling: Annotated[
        str | None, typer.Option(help="Constraints by feasibility or by penalty.", show_default=_own("feasibility"))
    ] = None,
    points: Annotated[int | None, typer.Option(help="Free points of the path.", show_default=_own("7"))] = None,
    nacelle_rate_deg_s: Annotated[
        float | None, typer.Option(help="Nacelle rate [deg/s].", show_default=_own("3"))
    ] = None,
    robust: Annotated[
        int | None,
        typer.Option(help="Flights in turbulence that judge each path; 0: calm air.", show_default=_own("0")),
    ] = None,
    options: dict[str, Any],
    jobs: Annotated[
        int | None, typer.Option(help="Threads that fly.", show_default="one per core", min=1, max=256)
    ] = None,
    dask: DaskAddress = None,
    dask_tls: DaskTls = None,
    out: Annotated[Path | None, typer.Option(help="Scenario file to write.", show_default="NAME.toml here")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the record beside the scenario file.")] = False,
    no_check: Annotated[bool, typer.Option("--no-check", help="Leave the nonlinear check flight out.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Search the best conversion path by flying every candidate in the closed loop.

    Examples:
        rtsim optimize --out best.toml  # the paper's search, some minutes
        rtsim optimize --like typical --generations 10 --out quick.toml
    """
    changes = {
        "objectives": objective,
        "points": points,
        "nacelle_rate_deg_s": nacelle_rate_deg_s,
        "search.generations": generations,
        "search.population": population,
        "search.seed": seed,
        "search.method": method,
        "search.handling": handling,
        "robust.flights": robust,
        **{f"flight.{declared()[name].key}": declared()[name].shown(value) for name, value in options.items()},
    }
    chosen = _specification(spec, like, {key: value for key, value in changes.items() if value is not None})
    scenario_file = out if out is not None else Path(f"{chosen.name}.toml")
    if scenario_file.suffix != ".toml":
        raise InputError("must end in .toml", key="--out", value=str(scenario_file))
    record_file = scenario_file.with_suffix(".search.npz")
    for file in (scenario_file, record_file):
        check_writable(file)
    if resume and not record_file.exists():
        raise InputError("there is no record to resume from", key="--resume", value=str(record_file))

    from rtsim.optimization.problem import ConversionProblem

    problem = ConversionProblem(chosen, workers=jobs)
    with cluster_of(dask, dask_tls, jobs, "the same command with --resume goes on") as cluster:
        result = _search(problem, cluster, record_file, resume=resume)
    summary = _save(problem, result, scenario_file, record_file, check=not no_check and not result.interrupted)
    if json:
        emit_json(summary)
    else:
        _print(summary)
    if result.interrupted:
        console.print("Stopped early; go on with the same command and --resume.")
    if result.stopped_by is not None:
        raise result.stopped_by


def _specification(file: Path | None, like: str | None, changes: dict[str, Any]) -> SearchSpec:
    from rtsim.optimization.spec import SearchSpec, checked_spec, load_spec, spec_like

    if file is not None and like is not None:
        raise InputError("cannot be combined with a specification file", key="--like", mend="give one of them")
    if file is not None:
        return load_spec(file, changes)
    base = spec_like(like) if like is not None else SearchSpec()
    if len(changes.get("objectives", ())) > 1:
        changes = {"search.method": "nsga2"} | changes
    return checked_spec(base.model_dump(), changes)


def _search(problem: ConversionProblem, cluster: Cluster | None, record_file: Path, *, resume: bool) -> SearchResult:
    from rtsim.optimization.cluster import ClusterEvaluator
    from rtsim.optimization.search import run_search

    evaluator = None if cluster is None else ClusterEvaluator(problem, cluster)
    with _progress_bar(problem.spec.search.generations) as told:
        return run_search(problem, evaluator=evaluator, record_path=record_file, resume=resume, on_progress=told)


@contextmanager
def _progress_bar(generations: int) -> Iterator[Callable[[Progress], None]]:
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("Searching"),
        BarColumn(bar_width=16),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[best]}"),
    )
    with Bar(*columns, console=console.real(), redirect_stderr=False) as bar:
        task = bar.add_task("search", total=generations, best="")

        def told(progress: Progress) -> None:
            mark = "" if progress.feasible else " (breaks a limit)"
            bar.update(task, completed=progress.generation, best=f"best {progress.best:.6g}{mark}")

        yield told


def _save(
    problem: ConversionProblem, result: SearchResult, scenario_file: Path, record_file: Path, *, check: bool
) -> dict[str, Any]:
    """Write the scenario file and put the answer together."""
    from rtsim.optimization.report import baseline_summary, best_path, figures_summary, nonlinear_check, scenario_text

    path = best_path(problem, result)
    write_whole(scenario_file, scenario_text(problem, path))
    spec = problem.spec
    flown = problem.fly([path])[0][0]
    summary: dict[str, Any] = {
        "name": spec.name,
        "method": spec.search.method,
        "handling": spec.search.handling,
        "seed": spec.search.seed,
        "database_hash": problem.database_hash,
        "best": {
            "objective": spec.objectives[0],
            "value": result.objectives[0],
            "objectives": dict(zip(spec.objectives, result.objectives, strict=True)),
            "feasible": result.feasible,
            "constraints": result.constraints,
            "points": _points(path),
            "duration_s": flown.duration_s,
            "figures": figures_summary(flown),
        },
        "baseline": baseline_summary(problem),
        "evaluations": result.evaluations,
        "generations": result.generations,
        "seconds_per_generation": result.seconds_per_generation,
        "interrupted": result.interrupted,
        "history": list(result.history),
        "scenario_file": str(scenario_file),
        "record_file": str(record_file),
    }
    if len(spec.objectives) > 1:
        summary["front"] = [
            {
                "objectives": dict(zip(spec.objectives, point.objectives, strict=True)),
                "points": _points(problem.path(point.variables)),
            }
            for point in result.front
        ]
    if check and problem.has_nonlinear_model:
        with working("Flying the winner on the nonlinear model"):
            checked = nonlinear_check(problem, path)
        summary["nonlinear_check"] = figures_summary(checked)
    return summary


def _points(path: ConversionPath) -> list[dict[str, float]]:
    return [{"airspeed_kt": point.airspeed_kt, "nacelle_deg": point.nacelle_deg} for point in path.points]


def _print(summary: dict[str, Any]) -> None:
    from rich.table import Table

    from rtsim.measures.metrics import OBJECTIVES

    best = summary["best"]
    words = OBJECTIVES[best["objective"]]
    unit = words[words.index("[") :] if "[" in words else ""
    table = Table(title=f"{summary['name']}: {words}")
    for column in ("path", f"{best['objective']} {unit}".strip(), "within limits", "duration [s]"):
        table.add_column(column, justify="left" if column == "path" else "right")
    rows = [("best found", best), *summary["baseline"].items()]
    for name, row in rows:
        table.add_row(name, f"{row['value']:.4g}", "yes" if row["feasible"] else "no", f"{row['duration_s']:.1f}")
    results.print(table)
    pace = summary["seconds_per_generation"]
    results.print(f"{summary['evaluations']} candidates in {summary['generations']} generations, {pace:.1f} s each.")
    if "nonlinear_check" in summary:
        flown = summary["nonlinear_check"]
        ending = "completes" if flown["completed"] else "DOES NOT complete"
        value = f"{flown['objectives'][best['objective']]:.4g} {unit.strip('[]')}".strip()
        results.print(
            f"The nonlinear model {ending} it: {best['objective']} {value}, "
            f"altitude within {flown['altitude_deviation_m']:.1f} m."
        )
    results.print(f"Wrote {summary['scenario_file']}; fly it with: rtsim fly {summary['scenario_file']}")
