"""``rtsim scenarios``: the library listed and described."""

from __future__ import annotations

import json
import subprocess
import sys

from scenarios.files.loader import library_names, load_scenario


def said(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rtsim", "scenarios", *words], capture_output=True, text=True, check=False
    )


def test_every_scenario_of_the_library_is_listed_with_kind_and_duration() -> None:
    listed = json.loads(said("--json").stdout)["scenarios"]
    assert [entry["name"] for entry in listed] == library_names()
    kinds = {entry["kind"] for entry in listed}
    assert kinds == {"flight", "nominal", "misuse", "failure", "unprotectable"}
    for entry in listed:
        assert entry["duration_s"] == load_scenario(entry["name"]).duration
        assert entry["title"]


def test_the_list_for_people_names_all_in_80_columns() -> None:
    text = said().stdout
    assert all(name in text for name in library_names())
    assert max(map(len, text.splitlines())) <= 80


def test_one_is_described_by_what_it_expects() -> None:
    text = said("ep26_one_collective_stuck").stdout
    assert "collective sticks" in text
    assert "expects: the corridor of the turn is kept" in text


def test_a_wrong_name_gets_the_likeliest_ones_and_where_the_rest_is() -> None:
    ended = said("standard_turn_60_57")
    assert ended.returncode == 2
    assert "perhaps 'standard_turn_60_75' is meant" in " ".join(ended.stderr.split())
    assert "rtsim scenarios lists them" in " ".join(ended.stderr.split())
