"""Writes the history hashes of many flights, and compares those of two trees.

A change that is meant to change no flight must leave every hash as it is, on one machine and one set of versions:

    python -m tests.regression.histories write /tmp/before.json --rows /tmp/before      # in the tree before
    python -m tests.regression.histories write /tmp/after.json --rows /tmp/after        # in the tree after
    python -m tests.regression.histories compare /tmp/before.json /tmp/after.json --rows /tmp/before /tmp/after

Hashes are never kept as truth: they hold for one machine type, one numpy, one numba. With ``--rows`` the frames are
kept too, and a difference is told as the largest one of every signal.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PLAIN = ("typical_conversion", "reconversion", "hover", "cruise", "conversion_8deg", "typical_conversion_rate3",
         "ep04_wrong_nacelle_command", "ep08_stick_pump", "ep11_jam_60_accelerating", "ep14_gust_beyond_authority",
         "ep16_airspeed_bias", "ep20_nominal_reconversion_turbulence")  # fmt: skip
"""Scenarios that are also flown on the plain LPV aircraft and on the nonlinear one."""
CAMPAIGN_RUNS = 20
"""Flights of each shipped campaign."""
LAW = "tests.regression.law_in_python:Careful"
"""A protection law in Python, so that the way through Python is flown too."""
PILOT = "tests.regression.law_in_python:Steady"


def _flights() -> Iterator[tuple[str, Any]]:
    """Whole flights of scenarios: name, and the frames."""
    import scenarios
    from scenarios.files.options import Overrides

    def fly(name: str, **changes: Any) -> Any:
        return scenarios.fly(name, speed="max", overrides=Overrides(**changes))

    for name in scenarios.library_names():
        if name != "manual_flight":  # its pilot is a person
            yield f"lpv/{name}", fly(name)
    for plant in ("lpv-plain", "nonlinear"):
        for name in PLAIN:
            yield f"{plant}/{name}", fly(name, plant=plant)
    for law in ("governor", "full"):
        yield f"{law}/ep04_wrong_nacelle_command", fly("ep04_wrong_nacelle_command", protection=law)
    yield "noise/typical_conversion", fly("typical_conversion", pilot_noise=True, seed=3, turbulence="moderate")
    yield "pi/typical_conversion", fly("typical_conversion", outer_loop="pi")
    yield "automatic/typical_conversion", fly("typical_conversion", nacelle="automatic")
    yield "wind/hover", fly("hover", wind=5.0)
    yield "law/ep04_wrong_nacelle_command", fly("ep04_wrong_nacelle_command", protection=LAW)
    yield "pilot/hover", fly("hover", pilot=PILOT, duration=20.0)
    yield "rate/reconversion", fly("reconversion", rate_hz=100)


def _trials() -> Iterator[tuple[str, Any]]:
    """The first flights of the shipped campaigns, under several laws."""
    from importlib import resources

    from scenarios.campaign.chunks import LawVariant, fly_law
    from scenarios.campaign.draws import draw_plan
    from scenarios.campaign.spec import parse_campaign
    from scenarios.campaign.trial import Bench

    for file in sorted((resources.files("scenarios.campaign") / "library").iterdir(), key=lambda item: item.name):
        spec, problems = parse_campaign(file.read_text(encoding="utf-8"), file=file.name)
        if spec is None:
            raise problems[0]
        bench = Bench()
        for number in range(CAMPAIGN_RUNS):
            place, run = number % len(spec.classes), number // len(spec.classes)
            plan = draw_plan(spec, seed=0, class_number=place, run=run)
            laws = ("off", "governor", "full") if number < 6 else ("full",)
            for law in (*laws, *((LAW,) if number == 0 else ())):
                flight = fly_law(bench, plan, LawVariant(law), keep=True)
                yield f"{spec.name}/{place}.{run}/{law}", flight


def _search() -> Iterator[tuple[str, str]]:
    """What the first generation of a search is worth."""
    from rtsim.optimization.problem import ConversionProblem
    from rtsim.optimization.spec import SearchSpec, checked_spec

    for label, changes in (
        ("plain", {}),
        ("robust", {"robust.flights": 2, "robust.turbulence": "light", "robust.pilot_noise": True}),
    ):
        problem = ConversionProblem(checked_spec(SearchSpec().model_dump(), {"search.population": 8, **changes}))
        candidates = np.random.default_rng(5).random((8, problem.variables))
        found = problem.evaluate(candidates)
        digest = hashlib.sha256()
        for array in (found.objectives, found.constraints):
            digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
        yield f"search/{label}", digest.hexdigest()


def write(file: Path, rows: Path | None, only: str) -> None:
    """Fly everything and write the hashes."""
    from rtsim.frame import SIGNAL_NAMES

    found: dict[str, str] = {}
    if rows is not None:
        rows.mkdir(parents=True, exist_ok=True)
        (rows / "signals.json").write_text(json.dumps(SIGNAL_NAMES), encoding="utf-8")
    groups = {"flights": _flights, "trials": _trials, "search": _search}
    for group, flights in groups.items():
        if only and only != group:
            continue
        for name, flight in flights():
            if isinstance(flight, str):
                found[name] = flight
            else:
                found[name] = flight.history_sha256
                if rows is not None:
                    np.save(rows / f"{name.replace('/', '~').replace(':', '=')}.npy", flight.rows)
            print(f"{found[name][:12]}  {name}", file=sys.stderr, flush=True)
            file.write_text(json.dumps(found, indent=1), encoding="utf-8")


def compare(before: Path, after: Path, rows: list[Path]) -> int:
    """Tell what differs; gives the number of differences."""
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    differing = sorted(name for name in {*old, *new} if old.get(name) != new.get(name))
    print(f"{len(old)} before, {len(new)} after, {len(differing)} differ")
    worst: dict[str, tuple[float, str]] = {}
    for name in differing:
        print(f"  {name}: {str(old.get(name))[:12]} -> {str(new.get(name))[:12]}")
        files = [folder / f"{name.replace('/', '~').replace(':', '=')}.npy" for folder in rows]
        if len(files) == 2 and all(path.is_file() for path in files):
            for signal, difference in _differences(rows, files):
                if difference > worst.get(signal, (0.0, ""))[0]:
                    worst[signal] = (difference, name)
    for signal, (difference, name) in sorted(worst.items(), key=lambda item: -item[1][0]):
        print(f"    {signal}: at most {difference:.3g} ({name})")
    return len(differing)


def _differences(folders: list[Path], files: list[Path]) -> Iterator[tuple[str, float]]:
    names = [json.loads((folder / "signals.json").read_text(encoding="utf-8")) for folder in folders]
    one, other = (np.load(path) for path in files)
    if len(one) != len(other):
        yield "frames flown", abs(len(one) - len(other))
    frames = min(len(one), len(other))
    for place, signal in enumerate(names[0]):
        if signal in names[1]:
            difference = np.abs(one[:frames, place] - other[:frames, names[1].index(signal)])
            yield signal, float(np.nanmax(difference, initial=0.0))


def main() -> int:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    writing = commands.add_parser("write", help="fly everything and write the hashes")
    writing.add_argument("file", type=Path)
    writing.add_argument("--rows", type=Path, help="folder for the frames of every flight (some 500 MB)")
    writing.add_argument("--only", default="", choices=("", "flights", "trials", "search"))
    comparing = commands.add_parser("compare", help="tell what differs between two trees")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--rows", type=Path, nargs=2, default=[], help="the folders of both")
    chosen = parser.parse_args()
    if chosen.command == "write":
        write(chosen.file, chosen.rows, chosen.only)
        return 0
    return 1 if compare(chosen.before, chosen.after, list(chosen.rows)) else 0


if __name__ == "__main__":
    raise SystemExit(main())
