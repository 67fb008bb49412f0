"""Keeps what a search has flown, generation by generation, so that it goes on where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from rtsim.errors import InputError
from rtsim.outside import understanding
from scenarios.campaign.kept_folder import KeptFolder
from scenarios.falsification.evaluation import Answer, Flyer, Query

NUMBERS = ("nacelle_deg", "airspeed_kt", "time_s", "flights", "seconds")
"""Numbers of an answer, in the order in which they are kept."""


class Record(KeptFolder):
    """A folder of generations, which flies what it does not hold."""

    def __init__(
        self, folder: Path, identity: dict[str, Any], flyer: Flyer, *, pieces: str, fresh: bool = False
    ) -> None:
        """Open or begin a folder.

        Args:
            folder: Where.
            identity: What makes this search this one.
            flyer: Who flies.
            pieces: Name of the folder of its generations.
            fresh: Throw finished generations away.

        Raises:
            InputError: The folder holds another search, or does not say which.
            OutputError: It cannot be written.
        """
        super().__init__(folder, identity, noun="search", pieces=pieces, fresh=fresh)
        self._where = folder / pieces
        self._flyer = flyer
        self._number = 0

    def __call__(self, queries: Sequence[Query]) -> list[Answer]:
        """Fly the next generation, or look up what came of it.

        Args:
            queries: Its points.

        Raises:
            InputError: Another generation stands there: it was made by another machine.
            OutputError: It cannot be written.
        """
        found = self._known(queries)
        if found is None:
            found = self._flyer(queries)
            self._keep(queries, found)
        self._number += 1
        return found

    @property
    def _name(self) -> str:
        return f"generation{self._number:06d}"

    def _known(self, queries: Sequence[Query]) -> list[Answer] | None:
        """What came of a generation; None where it is not finished."""
        data = self.load(self._name)
        if data is None:
            return None
        file, mend = str(self._where / f"{self._name}.npz"), "add --fresh to search anew"
        with understanding("record of a search", file=file, mend=mend):
            vectors = np.concatenate([query.vector for query in queries])
            classes = [query.class_number for query in queries]
            if data["classes"].tolist() != classes or not np.array_equal(data["vectors"], vectors):
                raise InputError("does not follow from this search's seed", file=file, mend=mend)
            problems = TypeAdapter(list[str]).validate_json(str(data["problems"].item()))
            named = ("robustness", "guidance", "numbers", "cells", "nearest")
            return [_answer(*one) for one in zip(*(data[name] for name in named), problems, strict=True)]

    def _keep(self, queries: Sequence[Query], answers: Sequence[Answer]) -> None:
        self.save(
            self._name,
            classes=[query.class_number for query in queries],
            vectors=np.concatenate([query.vector for query in queries]),
            robustness=[answer.robustness for answer in answers],
            guidance=[answer.guidance for answer in answers],
            numbers=[[float(getattr(answer, name)) for name in NUMBERS] for answer in answers],
            cells=_bytes([answer.cells for answer in answers]),
            nearest=_bytes([answer.nearest for answer in answers]),
            problems=json.dumps([answer.problem for answer in answers]),
        )


def _bytes(listed: list[bytes]) -> Any:
    """Bytes of answers as an array; those of a point without a flight are 0."""
    width = max(len(one) for one in listed)
    return [np.frombuffer(one.ljust(width, b"\0"), dtype=np.uint8) for one in listed]


def _answer(robustness: Any, guidance: Any, numbers: Any, cells: Any, nearest: Any, problem: str) -> Answer:
    named: dict[str, Any] = dict(zip(NUMBERS, numbers.tolist(), strict=True))
    named |= {"flights": int(named["flights"]), "problem": problem}
    if not named["flights"]:
        return Answer(robustness=robustness, guidance=guidance, cells=b"", nearest=b"", **named)
    found = {"cells": cells.tobytes(), "nearest": nearest.tobytes()}
    return Answer(robustness=robustness, guidance=guidance, **found, **named)
