"""``rtsim replay``: flies the recorded commands of a log again and compares the history bit by bit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rtsim.cli.flight_text import say
from rtsim.cli.output import emit_json, results, working
from rtsim.errors import EXIT_EXPECTATION_FAILED


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("replay")(replay_command)


def replay_command(
    log: Annotated[Path, typer.Argument(help="A flight log, as written by rtsim fly --log.")],
    *,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run the code of protection laws that the log names (MODULE:CLASS).")
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
) -> None:
    """Fly a log's commands again; exit 1 and the first differing frame and signal where the history differs.

    Examples:
        rtsim replay turn.parquet  # the same SHA-256, or where it differs
    """
    from scenarios.flight.replay import replay_log

    with working(f"Flying {log.name} again"):
        result = replay_log(log, trust=trust)
    for change in result.changed_versions:
        say(f"Not the same as when it was recorded: {change}.")
    if not result.complete:
        say("The recording was cut off; what there is of it is replayed.")
    edited = result.stated_sha256 not in {None, result.recorded_sha256}
    if edited:
        say("The log's rows do not have the hash it was closed with: they were damaged or edited.")
    if json:
        emit_json({"log": str(log), **_as_json(result)})
    elif result.same:
        results.print(f"The same: {result.rows} frames, {result.replayed_sha256}", markup=False, soft_wrap=True)
    elif result.difference is not None:
        at = result.difference
        results.print(
            f"Different from frame {at.frame} (row {at.row}) on: {at.signal} is {at.recorded!r} in the log and "
            f"{at.replayed!r} in the replay",
            markup=False,
            soft_wrap=True,
        )
    if not result.same:
        raise typer.Exit(EXIT_EXPECTATION_FAILED)


def _as_json(result: object) -> dict[str, object]:
    from dataclasses import asdict, is_dataclass

    assert is_dataclass(result)
    assert not isinstance(result, type)
    return asdict(result)
