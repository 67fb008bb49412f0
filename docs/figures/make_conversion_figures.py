"""Flies and draws the study of docs/conversion.md: ``python docs/figures/make_conversion_figures.py [RECORDS]``.

RECORDS is a directory in which the searches keep what they have flown; a second run then takes them from there.
Tables go to stdout as Markdown. About ten minutes on two cores, nearly all of it for the searches.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rtsim.aircraft.profile import xv15_profile
from rtsim.arrays import FloatArray
from rtsim.atmosphere.specification import AirSpecification, Turbulence
from rtsim.drawing import BLUE, GREEN, ORANGE, PURPLE, RED, REPORT_STYLE
from rtsim.loop.setup import FlightSetup
from rtsim.loop.simulation import Simulation
from rtsim.measures.metrics import FlightFigures, measured
from rtsim.nacelle.automatic import AutomaticNacelle
from rtsim.optimization.batch import BatchFlight, BatchFlyer
from rtsim.optimization.path import AccelerationCaps, ConversionPath
from rtsim.optimization.paths import PATH_NAMES, centre_line, centre_line_variable, near_stall, paper_path, table_1
from rtsim.optimization.problem import ConversionProblem
from rtsim.optimization.search import SearchResult, run_search
from rtsim.optimization.spec import SearchSpec, checked_spec, spec_like
from rtsim.pilot.weights import DisplaySettings, PilotSettings, pilot_settings
from rtsim.programme import Programme
from rtsim.units import deg
from scenarios.reproduction.drawing import draw_corridor
from scenarios.reproduction.flights import BASELINE, Flight, Flyer, Variant

HERE = Path(__file__).parent
TITLES = {
    "typical": "Table 1",
    "near_stall": "near stall",
    "centre_line": "centre line, 3 deg/s",
    "centre_line_variable": "centre line, variable rate",
    "fast_side": "fast side",
    "optimum": "optimum",
}
COLOURS = dict(zip(TITLES, (ORANGE, PURPLE, GREEN, BLUE, RED, "black"), strict=True))
SETS = {
    "fast_side": "3 deg/s, 1.5 kn/s (fast side's)",
    "near_stall": "3 deg/s, 2 kn/s (near stall's)",
    "typical": "3 deg/s, 3 to 4 kn/s (Table 1's)",
    "centre_line_variable": "12 deg/s, 4 kn/s (variable rate's)",
}
"""Constraint sets of the fronts: nacelle rate and acceleration caps of the paper's paths."""
SEEDS = range(20)


def searched(spec: SearchSpec, records: Path | None) -> tuple[ConversionProblem, SearchResult]:
    """Search, or take what was searched before."""
    problem = ConversionProblem(spec)
    record = None if records is None else records / f"{spec.name}_{len(spec.objectives)}.search.npz"
    return problem, run_search(problem, record_path=record)


def front_spec(name: str) -> SearchSpec:
    """The search for the front between flapping integral and stick effort, within one path's constraint set."""
    data = spec_like(name).model_dump()
    data["objectives"] = ["flapping_integral", "stick_effort"]
    data["search"] |= {"method": "nsga2", "generations": 50, "population": 40}
    return checked_spec(data)


def fly(
    paths: dict[str, ConversionPath],
    *,
    seeds: range = range(1),
    automatic: AutomaticNacelle | None = None,
    turbulence: str | None = None,
    noise: bool = False,
) -> dict[str, list[FlightFigures]]:
    """Fly paths, each with every seed; the pilot is free of noise, so that effort shows what the air asks for."""
    programmes: list[Programme] = [path.programme() for path in paths.values()]
    air = AirSpecification() if turbulence is None else AirSpecification(turbulence=Turbulence.of_severity(turbulence))
    setup = FlightSetup(programme=programmes[0], air=air, automatic_nacelle=automatic)
    flown = BatchFlyer(setup.with_options(pilot_noise=noise)).fly(
        [BatchFlight(programme, seed) for programme in programmes for seed in seeds]
    )
    count = len(seeds)
    return {name: flown[k * count : (k + 1) * count] for k, name in enumerate(paths)}


def figures_of(flight: Flight) -> FlightFigures:
    """Measure a flight."""
    return FlightFigures(measured(flight.rows, flight.programme, 0.004, ended=not flight.completed))


def say(line: str) -> None:
    """Print a line."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def row(*cells: object) -> None:
    """Print a row of a Markdown table."""
    say("| " + " | ".join(str(cell) for cell in cells) + " |")


def head(*cells: str) -> None:
    """Print the head of a Markdown table."""
    say("")
    row(*cells)
    row(*("---" for _ in cells))


def picture(width: float = 7.6, height: float = 4.2) -> Figure:
    """An empty figure."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, name: str) -> None:
    """Write a figure beside this script."""
    figure.savefig(HERE / f"conversion_{name}.png", dpi=130, metadata={"Software": None})


def fronts(paths: dict[str, ConversionPath], records: Path | None) -> None:
    """Pareto fronts between flapping and workload, the paper's paths among them."""
    figure = picture(7.6, 4.8)
    axes = figure.subplots()
    head(
        "constraint set",
        "least flapping integral, deg s (effort, in/s)",
        "least effort, in/s (integral, deg s)",
        "points",
    )
    for name, colour in zip(SETS, ("#9fb6cd", "#6f9bc4", "#3b78b0", "#123f6d"), strict=True):
        _, result = searched(front_spec(name), records)
        points = np.array(sorted(point.objectives for point in result.front))
        axes.plot(points[:, 0], points[:, 1], "-o", color=colour, markersize=3, linewidth=1.2, label=SETS[name])
        least, calm = points[0], points[np.argmin(points[:, 1])]
        row(SETS[name], f"{least[0]:.1f} ({least[1]:.3f})", f"{calm[1]:.3f} ({calm[0]:.1f})", len(points))
    for name, (flight,) in fly({name: paths[name] for name in PATH_NAMES}).items():
        x, y = flight.flapping_integral_deg_s, flight.stick.rms_rate
        axes.plot(x, y, "*", color=COLOURS[name], markersize=14, markeredgecolor="white", zorder=4)
        axes.annotate(TITLES[name], (x, y), xytext=(0, 9), textcoords="offset points", fontsize=9, ha="center")
    axes.set(xlabel="integral of cyclic flapping, deg s", ylabel="stick effort (RMS rate), in/s")
    axes.legend(title="fronts, by what may be flown", alignment="left")
    save(figure, "front")


def optimum_and_paths(paths: dict[str, ConversionPath]) -> None:
    """The optimum beside the paper's paths: where it runs, what flaps, in numbers."""
    figure = picture(11.0, 4.2)
    left, right = figure.subplots(1, 2)
    draw_corridor(left)
    head("path", "170 kn at, s", "flapping integral, deg s", "peak, deg", "stick effort, in/s", "lever effort, 1/s",
         "margin, kn", "altitude, m", "pitch, deg", "energy, MJ")  # fmt: skip
    flyer = Flyer(BASELINE)
    for name, path in paths.items():
        flight = flyer.fly(name, path)
        wide = {"linewidth": 2.4} if name == "optimum" else {"linewidth": 1.2}
        left.plot(flight["airspeed_kt"][::10], flight["nacelle_deg"][::10], color=COLOURS[name], **wide)
        right.plot(flight.time[::10], flight["flapping_deg"][::10], color=COLOURS[name], label=TITLES[name], **wide)
        found = figures_of(flight)
        arrived = flight.time[np.argmax(flight["airspeed_kt"] >= 169.5)]
        row(TITLES[name], f"{arrived:.1f}", f"{found.flapping_integral_deg_s:.1f}", f"{found.flapping_peak_deg:.2f}",
            f"{found.stick.rms_rate:.3f}", f"{found.lever.rms_rate:.4f}", f"{found.worst_margin_kt:.1f}",
            f"{found.altitude_deviation_m:.1f}", f"{found.pitch_min_deg:.0f} to {found.pitch_max_deg:.0f}",
            f"{found.energy_mj:.1f}")  # fmt: skip
    right.set(xlabel="time, s", ylabel="cyclic flapping, deg", ylim=(0.0, 6.0))
    right.margins(x=0.0)
    right.legend()
    save(figure, "paths")
    points = [f"({p.airspeed_kt:.0f} kn, {p.nacelle_deg:.0f} deg)" for p in paths["optimum"].points]
    say("\noptimum: " + " ".join(points))


def rates(optimum: ConversionPath) -> None:
    """The same paths at other nacelle rates and accelerations."""
    values = np.array([1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 9.0, 10.5, 12.0])
    caps = AccelerationCaps()

    def at(rate: float) -> dict[str, ConversionPath]:
        return {
            "typical": table_1(nacelle_rate_deg_s=rate),
            "near_stall": near_stall(nacelle_rate_deg_s=rate, caps=caps),
            "centre_line": centre_line(nacelle_rate_deg_s=rate),
            "optimum": optimum.with_rates(nacelle_rate_deg_s=rate, caps=caps, name="optimum"),
        }

    flown = [{name: flights[0] for name, flights in fly(at(float(rate))).items()} for rate in values]
    figure = picture(11.0, 3.8)
    panels = (
        ("flapping integral, deg s", lambda f: f.flapping_integral_deg_s),
        ("flapping peak, deg", lambda f: f.flapping_peak_deg),
        ("stick effort (RMS rate), in/s", lambda f: f.stick.rms_rate),
    )
    for axes, (label, value) in zip(figure.subplots(1, 3), panels, strict=True):
        for name in flown[0]:
            title = "centre line" if name == "centre_line" else TITLES[name]
            axes.plot(values, [value(one[name]) for one in flown], "-o", color=COLOURS[name], markersize=3, label=title)
        axes.set(xlabel="nacelle rate, deg/s", title=label)
    figure.axes[0].legend()
    save(figure, "rate")
    head("nacelle rate, deg/s", *("centre line" if n == "centre_line" else TITLES[n] for n in flown[0]))
    for rate, one in zip(values, flown, strict=True):
        if rate in {1.5, 3.0, 5.0, 7.5, 12.0}:
            row(f"{rate:g}", *(f"{f.flapping_integral_deg_s:.0f} / {f.flapping_peak_deg:.1f} / {f.stick.rms_rate:.2f}"
                               for f in one.values()))  # fmt: skip


def accelerations() -> None:
    """The centre line at variable rate, faster and slower; the nonlinear model beside the LPV aircraft."""
    head("acceleration, kn/s", "170 kn at, s", "integral, deg s", "peak, deg (nonlinear)", "stick effort, in/s",
         "largest nacelle rate, deg/s", "altitude, m (nonlinear)", "mast torque, 1000 in lb")  # fmt: skip
    truth = Flyer(Variant(name="nonlinear", title="", plant="nonlinear"))
    for acceleration in (1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5):
        path = centre_line_variable(acceleration_kt_s=acceleration)
        flight = Flyer(BASELINE).fly(path.name, path)
        real = figures_of(truth.fly(path.name, path))
        found = figures_of(flight)
        arrived = flight.time[np.argmax(flight["airspeed_kt"] >= 169.5)]
        row(f"{acceleration:g}", f"{arrived:.1f}", f"{found.flapping_integral_deg_s:.0f}",
            f"{found.flapping_peak_deg:.2f} ({real.flapping_peak_deg:.2f})", f"{found.stick.rms_rate:.3f}",
            f"{found.nacelle_max_rate_deg_s:.1f}",
            f"{found.altitude_deviation_m:.1f} ({real.altitude_deviation_m:.1f})",
            f"{found.mast_torque_max_inlb / 1000:.0f}")  # fmt: skip


def displays(settings: PilotSettings, names: tuple[str, ...], key: str, factor: float) -> PilotSettings:
    """A pilot to whom some displays matter less or more; scaling all maxima alike would change nothing."""
    changed: dict[str, DisplaySettings] = {}
    for name in names:
        display = getattr(settings, name)
        changed[name] = dataclasses.replace(display, **{key: factor * getattr(display, key)})
    return dataclasses.replace(settings, **changed)


def pilots(paths: dict[str, ConversionPath]) -> None:
    """The same paths by other pilots."""
    plain = pilot_settings(xv15_profile())
    path_displays = ("airspeed", "altitude", "climb_rate")
    variants: dict[str, PilotSettings | None] = {
        "delay 0.10 s": dataclasses.replace(plain, delay=0.10),
        "as shipped (0.17 s)": None,
        "delay 0.25 s": dataclasses.replace(plain, delay=0.25),
        "delay 0.35 s": dataclasses.replace(plain, delay=0.35),
        "slow hands (lags x 2)": dataclasses.replace(plain, stick_lag=0.2, lever_lag=0.4),
        "lax on airspeed, height (x 3)": displays(plain, path_displays, "maximum", 3.0),
        "strict on airspeed, height (/ 3)": displays(plain, path_displays, "maximum", 1.0 / 3.0),
        "a third of the attention": displays(plain, (*path_displays, "pitch", "pitch_rate"), "attention", 1.0 / 3.0),
        "outer PI loops": None,
    }
    head("pilot", *(TITLES[name] for name in paths))
    flown: dict[str, list[FlightFigures]] = {}
    for title, settings in variants.items():
        loop = "pi" if "PI" in title else "integrators"
        flyer = Flyer(Variant(name="study", title=title, outer_loop=loop, pilot=settings), jobs=2)
        flights: list[Flight] = [flyer.fly(name, path) for name, path in paths.items()]
        flown[title] = [figures_of(flight) for flight in flights]
        row(title, *(f"{f.flapping_integral_deg_s:.0f} / {f.stick.rms_rate:.2f} / {f.altitude_deviation_m:.1f}"
                     + ("" if f.completed else " (ended)") for f in flown[title]))  # fmt: skip
    figure = picture(11.0, 3.8)
    place = np.arange(len(variants))
    panels = (
        ("flapping integral, deg s", lambda f: f.flapping_integral_deg_s),
        ("stick effort (RMS rate), in/s", lambda f: f.stick.rms_rate),
    )
    for number, (axes, (label, value)) in enumerate(zip(figure.subplots(1, 2, sharey=True), panels, strict=True)):
        for k, name in enumerate(paths):
            values = [value(flown[title][k]) for title in variants]
            axes.plot(values, place, "o", color=COLOURS[name], markersize=6, label=TITLES[name])
        axes.set(xlabel=label, yticks=place, ylim=(len(variants) - 0.5, -0.5))
        axes.set_xlim(left=0.0)
        if number == 0:
            axes.set_yticklabels(list(variants))
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    save(figure, "pilot")


def spread(flights: list[FlightFigures], value: str) -> tuple[float, float]:
    """Mean and standard deviation of a figure over flights."""
    values: FloatArray = np.array([getattr(f, value) if value != "effort" else f.stick.rms_rate for f in flights])
    return float(values.mean()), float(values.std())


def turbulence(paths: dict[str, ConversionPath]) -> None:
    """The same paths with the pilot's noise and in turbulence; all paths meet the same twenty airs."""
    flown = {"calm": fly(paths), "pilot noise": fly(paths, seeds=SEEDS, noise=True)}
    flown |= {level: fly(paths, seeds=SEEDS, turbulence=level) for level in ("light", "moderate", "severe")}
    levels = tuple(flown)
    head("path", *levels)
    for name in paths:
        cells = []
        for level in levels:
            flights = flown[level][name]
            integral, effort = spread(flights, "flapping_integral_deg_s"), spread(flights, "effort")
            altitude = max(f.altitude_deviation_m for f in flights)
            ended = sum(not f.completed for f in flights)
            text = f"{integral[0]:.0f} ± {integral[1]:.0f}; {effort[0]:.2f} ± {effort[1]:.2f}; {altitude:.1f}"
            cells.append(text + (f" ({ended} ended)" if ended else ""))
        row(TITLES[name], *cells)
    figure = picture(11.0, 3.8)
    levels = tuple(level for level in levels if level != "pilot noise")  # its effort would dwarf all else
    panels = (("flapping integral, deg s", "flapping_integral_deg_s"), ("stick effort (RMS rate), in/s", "effort"))
    for axes, (label, value) in zip(figure.subplots(1, 2), panels, strict=True):
        for k, name in enumerate(paths):
            found = np.array([spread(flown[level][name], value) for level in levels])
            place = np.arange(len(levels)) + 0.06 * (k - 2.5)
            axes.errorbar(place, found[:, 0], yerr=found[:, 1], color=COLOURS[name], fmt="-o", markersize=4,
                          linewidth=1.0, capsize=2, label=TITLES[name])  # fmt: skip
        axes.set(xticks=range(len(levels)), xticklabels=levels, title=label)
        axes.set_ylim(bottom=0.0)
    figure.axes[0].legend(ncols=2, fontsize=8)
    save(figure, "turbulence")


def automatic() -> None:
    """What the automatic nacelle control gains: the same airspeeds, the nacelles by programme or by airspeed."""
    table = dataclasses.replace(table_1(), nacelle_motion="spread")
    flights: list[tuple[str, ConversionPath, AutomaticNacelle | None]] = [("Table 1, its own nacelles", table, None)]
    flights += [(f"Table 1's airspeeds, automatic to {rate:g} deg/s", table, AutomaticNacelle(rate=deg(rate)))
                for rate in (3.0, 7.5, 12.0)]  # fmt: skip
    for acceleration in (3.0, 4.0):
        ramp = centre_line_variable(acceleration_kt_s=acceleration)
        flights.append((f"centre line planned, {acceleration:g} kn/s", ramp, None))
        flights += [(f"{acceleration:g} kn/s, automatic to {rate:g} deg/s", ramp, AutomaticNacelle(rate=deg(rate)))
                    for rate in (7.5, 12.0)]  # fmt: skip
    columns = ("integral, deg s", "stick effort, in/s", "margin, kn", "altitude, m")
    head("flight", columns[0], "peak, deg", *columns[1:], "largest rate, deg/s", *(f"turbulence: {c}" for c in columns))
    for title, path, law in flights:
        calm = fly({"it": path}, automatic=law)["it"][0]
        rough = fly({"it": path}, automatic=law, turbulence="moderate", seeds=SEEDS)["it"]
        integral, effort = spread(rough, "flapping_integral_deg_s"), spread(rough, "effort")
        row(title, f"{calm.flapping_integral_deg_s:.0f}", f"{calm.flapping_peak_deg:.2f}", f"{calm.stick.rms_rate:.3f}",
            f"{calm.worst_margin_kt:.1f}", f"{calm.altitude_deviation_m:.1f}", f"{calm.nacelle_max_rate_deg_s:.1f}",
            f"{integral[0]:.0f} ± {integral[1]:.0f}", f"{effort[0]:.2f}",
            f"{min(f.worst_margin_kt for f in rough):.1f}",
            f"{max(f.altitude_deviation_m for f in rough):.1f}")  # fmt: skip


def automatic_figure() -> None:
    """Table 1 with its own nacelles and with the automatic ones."""
    programme = dataclasses.replace(table_1(), nacelle_motion="spread").programme()
    figure = picture(11.0, 4.0)
    left, right = figure.subplots(1, 2)
    draw_corridor(left)
    for law, colour, label in (
        (None, ORANGE, "Table 1, its own nacelles"),
        (AutomaticNacelle(rate=deg(3.0)), GREEN, "automatic, up to 3 deg/s"),
        (AutomaticNacelle(rate=deg(7.5)), BLUE, "automatic, up to 7.5 deg/s"),
    ):
        setup = FlightSetup(programme=programme, automatic_nacelle=law)
        rows = Simulation(setup).run(round(programme.duration * setup.options.rate_hz))
        flight = Flight("", programme, rows, "")
        left.plot(flight["airspeed_kt"][::10], flight["nacelle_deg"][::10], color=colour, label=label)
        right.plot(flight.time[::10], flight["flapping_deg"][::10], color=colour, label=label)
    right.set(xlabel="time, s", ylabel="cyclic flapping, deg", ylim=(0.0, 6.0))
    right.margins(x=0.0)
    right.legend()
    save(figure, "automatic")


def main() -> None:
    """Fly, print and draw everything."""
    records = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    if records is not None:
        records.mkdir(parents=True, exist_ok=True)
    problem, result = searched(spec_like("typical"), records)
    paths = {name: paper_path(name) for name in PATH_NAMES}
    paths["optimum"] = dataclasses.replace(problem.path(result.best), name="optimum")
    with rc_context(REPORT_STYLE):
        optimum_and_paths(paths)
        rates(paths["optimum"])
        accelerations()
        automatic()
        automatic_figure()
        turbulence(paths)
        pilots(paths)
        fronts(paths, records)


if __name__ == "__main__":
    main()
