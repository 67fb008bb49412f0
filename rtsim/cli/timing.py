"""``rtsim timing``: how well this machine holds the period of a real-time flight."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtsim.cli.flight_text import say
from rtsim.cli.output import emit_json, results
from rtsim.drawing import check_picture, drawing
from rtsim.errors import InputError
from rtsim.whole_file import check_writable, whole_file

if TYPE_CHECKING:
    from rtsim.realtime.report import TimingLog, TimingReport

LATENESS_GOAL_US = 10.0
"""Median lateness to hold [us]."""
WORK_GOAL_US = 250.0
"""99th percentile of the work's CPU time to hold [us]."""
DRIFT_GOAL_FRAMES = 1.0
"""Drift to hold [frames]."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("timing")(timing_command)


def timing_command(
    *,
    duration: Annotated[float, typer.Option(help="How long to measure [s].")] = 10.0,
    rate: Annotated[int, typer.Option(help="Frames per second [Hz].")] = 250,
    plot: Annotated[
        Path | None, typer.Option(help="Draw histograms into FILE (.png, .svg or .pdf).", show_default="none")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Fly the hover in real time and report lateness, work, overruns and drift.

    Examples:
        rtsim timing --duration 20 --plot timing.png  # how well this machine holds 250 Hz
    """
    if plot is not None:
        check_picture(plot, "--plot")
        check_writable(plot)
    from rtsim.loop.options import declared

    if not 0.1 <= duration <= 3600.0:
        raise InputError(
            "is out of range", key="--duration", value=duration, allowed="0.1 to 3600 s", mend="choose one"
        )
    declared()["rate_hz"].check(rate)
    say(f"Flying the hover at {rate} Hz for {duration:g} s; leave the machine alone meanwhile.")
    report, log = _measure(duration, rate)
    if plot is not None:
        _draw(log, plot, rate)
    if json:
        emit_json(_as_json(report, rate) | ({} if plot is None else {"plot_file": str(plot)}))
    else:
        _print(report, rate)


def _measure(duration: float, rate: int) -> tuple[TimingReport, TimingLog]:
    """Fly the hover live, with nothing attached to it."""
    from rtsim.loop.simulation import Simulation
    from rtsim.realtime.executive import Executive
    from scenarios.files.loader import load_scenario
    from scenarios.files.options import Overrides, with_overrides
    from scenarios.flight.flight_setup import flight_frames, flight_setup
    from scenarios.flight.session import FlightSession
    from scenarios.flight.sinks import FlightSinks

    scenario = with_overrides(load_scenario("hover"), Overrides(duration=duration, rate_hz=rate))
    simulation = Simulation(flight_setup(scenario))
    simulation.warm_up()
    executive = Executive(FlightSession(simulation, frames=flight_frames(scenario)), FlightSinks())
    return executive.fly(), executive.log


def goals(report: TimingReport) -> list[tuple[str, float, float, bool]]:
    """What is to be held, what was measured, and whether it held.

    Args:
        report: A paced flight's timing.
    """
    assert report.lateness_us is not None
    assert report.work_cpu_us is not None
    assert report.drift_frames is not None
    measured = (
        ("lateness p50 [us]", report.lateness_us.p50, LATENESS_GOAL_US),
        ("work p99, CPU [us]", report.work_cpu_us.p99, WORK_GOAL_US),
        ("drift [frames]", report.drift_frames, DRIFT_GOAL_FRAMES),
    )
    return [(name, value, goal, value <= goal) for name, value, goal in measured]


def _as_json(report: TimingReport, rate: int) -> dict[str, Any]:
    return {
        "rate_hz": rate,
        "period_us": 1e6 / rate,
        "frames": report.frames,
        "duration_s": report.duration_s,
        "wall_s": report.wall_s,
        "overruns": report.overruns,
        "overrun_frames": report.overrun_frames,
        "lateness_us": report.lateness_us,
        "work_us": report.work_us,
        "work_cpu_us": report.work_cpu_us,
        "drift_frames": report.drift_frames,
        "goals": [
            {"name": name, "value": value, "limit": goal, "held": held} for name, value, goal, held in goals(report)
        ],
    }


def _print(report: TimingReport, rate: int) -> None:
    from rich.table import Table

    table = Table(title=f"{report.frames} frames of {1e6 / rate:.0f} us", title_justify="left")
    for heading in ("", "p50 [us]", "p99 [us]", "max [us]"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, spread in (
        ("lateness", report.lateness_us),
        ("work, wall", report.work_us),
        ("work, CPU", report.work_cpu_us),
    ):
        if spread is not None:
            table.add_row(name, f"{spread.p50:.1f}", f"{spread.p99:.1f}", f"{spread.max:.1f}")
    results.print(table)
    results.print(f"Overruns {report.overruns}, drift {report.drift_frames:.2f} frames")
    for name, value, goal, held in goals(report):
        results.print(f"  {'held  ' if held else 'MISSED'} {name}: {value:.2f} (limit {goal:g})", markup=False)


@drawing()
def _draw(log: TimingLog, path: Path, rate: int) -> None:
    """Histograms of lateness and work on logarithmic axes."""
    import matplotlib.pyplot as plt
    import numpy as np

    from rtsim.realtime.report import microseconds

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    edges = np.logspace(-1, 5, 121)
    for axis, title, values in (
        (axes[0], "Lateness of frame starts", (("lateness", log.lateness_ns),)),
        (axes[1], "Work per frame", (("wall", log.work_ns), ("thread CPU", log.work_cpu_ns))),
    ):
        for name, data in values:
            axis.hist(np.maximum(microseconds(data), edges[0]), bins=edges, histtype="step", label=name)
        axis.axvline(1e6 / rate, color="black", linestyle=":", label="period")
        axis.set(title=title, xlabel="time [us]", xscale="log", yscale="log")
        axis.legend()
    axes[0].set_ylabel("frames")
    try:
        with whole_file(path) as temporary:
            figure.savefig(temporary)
    except ValueError as error:
        raise InputError(
            "is no kind of picture that can be drawn",
            key="--plot",
            value=str(path),
            mend="end it in .png, .svg or .pdf",
        ) from error
    finally:
        plt.close(figure)
