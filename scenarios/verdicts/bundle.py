"""What is needed to look at a failed test again: its scenario, its verdict, and logs that replay to the same hash."""

from __future__ import annotations

import dataclasses
import json
import shlex
import shutil
from pathlib import Path
from typing import Any

from rtsim.errors import OutputError
from rtsim.jsonable import to_jsonable
from rtsim.protection.tables import LAW_NAMES
from scenarios.flight.flight_setup import versions
from scenarios.flight.runner import FlightOutputs, fly
from scenarios.verdicts.tester import Case


def write_bundle(case: Case, folder: Path) -> Path:
    """Write the bundle of a case.

    Args:
        case: The case.
        folder: Where bundles go; an earlier one of the same scenario is replaced.

    Returns:
        The bundle's folder: ``scenario.toml``, ``verdict.json``, and for laws of rtsim's own the flight logs
        ``law.parquet`` and ``off.parquet``.

    Raises:
        OutputError: It cannot be written.
    """
    target = folder / case.name
    part = folder / f".{case.name}.part"
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        if case.scenario.source:
            (part / "scenario.toml").write_text(case.scenario.source, encoding="utf-8")
        logs = _logs(case, part)
        verdict = {**case.summary(), "versions": versions(), "logs": logs, "replay": _commands(case, logs)}
        (part / "verdict.json").write_text(json.dumps(to_jsonable(verdict), indent=1), encoding="utf-8")
        shutil.rmtree(target, ignore_errors=True)
        part.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror or error}.") from error
    return target


def _logs(case: Case, part: Path) -> dict[str, Any]:
    """Fly both flights again with a log; their hashes must be those that were judged."""
    found: dict[str, Any] = {}
    laws = [("law", case.law)] if case.law in LAW_NAMES else []
    if case.off is not None:
        laws.append(("off", "off"))
    for place, law in laws:
        scenario = dataclasses.replace(
            case.scenario.with_options(protection=law, corridor=case.scenario.options.corridor_name), expectations=()
        )
        path = part / f"{place}.parquet"
        record = fly(scenario, speed="max", outputs=FlightOutputs(log=path))
        judged = case.flight if place == "law" or case.off is None else case.off
        found[place] = {
            "log": path.name,
            "history_sha256": record.history_sha256,
            "same_as_judged": record.history_sha256 == judged.history_sha256,
        }
    return found


def _commands(case: Case, logs: dict[str, Any]) -> list[str]:
    law = shlex.quote(case.law)
    options = case.scenario.options
    database = f" --database {shlex.quote(options.database)}" if options.database else ""
    commands = [f"rtsim test scenario.toml --protection {law} --plant {options.plant}{database}"]
    return commands + [f"rtsim replay {item['log']}" for item in logs.values()]
