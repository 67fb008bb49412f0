"""What is needed to look at a failed test again: its scenario, its verdict, and logs that replay to the same hash."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import secrets
import shlex
import shutil
from pathlib import Path
from typing import Any

from rtsim.aircraft.profile import OWN_SUFFIX
from rtsim.errors import OutputError
from rtsim.jsonable import to_jsonable
from rtsim.loop.options import FlightOptions, declared
from rtsim.protection.tables import LAW_NAMES
from rtsim.versions import versions
from scenarios.files.loader import parse_scenario
from scenarios.files.scenario import Scenario
from scenarios.flight.runner import FlightOutputs, fly
from scenarios.verdicts.tester import Case

VERDICT = "verdict.json"
"""What a bundle says about itself; ``files`` are the names that it holds."""


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
    check_bundle(case.name, folder)
    target = folder / case.name
    part = folder / f".{case.name}.{secrets.token_hex(8)}.part"
    try:
        part.mkdir(parents=True)
        text = _complete(case.scenario, part)
        logs = _logs(case, part)
        files = sorted(item.name for item in part.iterdir())
        verdict = {**case.summary(), "versions": versions(), "logs": logs, "replay": _commands(case, text, logs)}
        content = json.dumps(to_jsonable({**verdict, "files": [*files, VERDICT]}), indent=1)
        (part / VERDICT).write_text(content, encoding="utf-8")
        shutil.rmtree(target, ignore_errors=True)
        part.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror or error}.") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    different = [item["log"] for item in logs.values() if not item["same_as_judged"]]
    if different:
        raise OutputError(
            f"{target}: the flight of {' and '.join(different)}, flown again for the bundle, differs from the one that "
            "was judged. Please report it, with the bundle."
        )
    return target


def check_bundle(name: str, folder: Path) -> None:
    """Refuse a place for a bundle where something stands that is no bundle, or more than one.

    Args:
        name: Name of the scenario.
        folder: Where bundles go.

    Raises:
        OutputError: Something of somebody else's would be lost.
    """
    target = folder / name
    if not os.path.lexists(target):
        return
    try:
        known = set(json.loads((target / VERDICT).read_text(encoding="utf-8"))["files"])
        foreign = sorted({item.name for item in target.iterdir()} - known)
    except (OSError, ValueError, KeyError, TypeError):
        foreign = [""]
    if foreign or target.is_symlink():
        raise OutputError(
            f"{target}: a bundle cannot be written here: {foreign[0] or 'what stands there'} is not of an earlier one; "
            "move it away, or choose another folder."
        )


def _complete(scenario: Scenario, part: Path) -> str:
    """Write a scenario with every file that it names beside it; give its text, which names them there."""
    text = scenario.source
    for item in declared().values():
        named = getattr(scenario.options, item.name)
        if not item.is_file or not named:
            continue
        file = Path(named)
        for original in (file, file.with_name(file.stem + OWN_SUFFIX)):
            if original.is_file():
                shutil.copyfile(original, part / original.name)
        # No other key of a scenario is called so; the text may come with quotes of either kind.
        line = rf"""(\b{item.key}\s*=\s*)("[^"\n]*"|'[^'\n]*')"""
        if found := re.search(line, text):
            text = text[: found.start(2)] + json.dumps(file.name, ensure_ascii=False) + text[found.end(2) :]
    if text:
        (part / "scenario.toml").write_text(text, encoding="utf-8")
    return text


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


def _commands(case: Case, text: str, logs: dict[str, Any]) -> list[str]:
    """What judges the bundle's scenario again as it was judged, and what replays its logs; to be run in its folder."""
    options, own = case.scenario.options, FlightOptions()
    if text and (scenario := parse_scenario(text, file="scenario.toml")[0]) is not None:
        own = scenario.options
    words = ["rtsim", "test", "scenario.toml", "--protection", case.law]
    for name, item in declared().items():
        value, said = (
            Path(one).name if item.is_file and one else one for one in (getattr(options, name), getattr(own, name))
        )
        if value != said and name not in {
            "protection",
            "corridor",
        }:  # the law says the one, and the other follows from it
            words += [item.flag, str(item.shown(value))]
    return [shlex.join(words), *(f"rtsim replay {item['log']}" for item in logs.values())]
