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
from scenarios.falsification.evaluation import Answer, Query

NUMBERS = ("nacelle_deg", "airspeed_kt", "time_s", "margin_kt", "high", "flights", "seconds")
"""Numbers of an answer, in the order in which they are kept."""


class Record(KeptFolder):
    """A folder of generations."""

    def __init__(self, folder: Path, identity: dict[str, Any], *, pieces: str, fresh: bool = False) -> None:
        """Open or begin a folder.

        Args:
            folder: Where.
            identity: What makes this search this one.
            pieces: Name of the folder of its generations.
            fresh: Throw finished generations away.

        Raises:
            InputError: The folder holds another search, or does not say which.
            OutputError: It cannot be written.
        """
        super().__init__(folder, identity, noun="search", pieces=pieces, fresh=fresh)
        self._where = folder / pieces

    def answers(self, number: int, queries: Sequence[Query]) -> list[Answer] | None:
        """What came of a generation; None where it is not finished.

        Args:
            number: Its number.
            queries: What is asked.

        Raises:
            InputError: Another generation stands there: it was made by another machine.
        """
        name = f"generation{number:06d}"
        data = self.load(name)
        if data is None:
            return None
        mend = "add --fresh to search anew"
        with understanding("record of a search", file=self._where / f"{name}.npz", mend=mend):
            vectors = np.concatenate([query.vector for query in queries])
            classes = [query.class_number for query in queries]
            if data["classes"].tolist() != classes or not np.array_equal(data["vectors"], vectors):
                raise InputError("does not follow from this search's seed", file=name, mend=mend)
            problems = TypeAdapter(list[str]).validate_json(str(data["problems"].item()))
            kept = zip(data["robustness"], data["numbers"].tolist(), data["cells"], problems, strict=True)
            return [_answer(robustness, numbers, cells, problem) for robustness, numbers, cells, problem in kept]

    def keep(self, number: int, queries: Sequence[Query], answers: Sequence[Answer]) -> None:
        """Keep a generation.

        Args:
            number: Its number.
            queries: What was asked.
            answers: What came of it.

        Raises:
            OutputError: It cannot be written.
        """
        width = max(len(answer.cells) for answer in answers)
        self.save(
            f"generation{number:06d}",
            classes=[query.class_number for query in queries],
            vectors=np.concatenate([query.vector for query in queries]),
            robustness=[answer.robustness for answer in answers],
            numbers=[[float(getattr(answer, name)) for name in NUMBERS] for answer in answers],
            cells=[np.frombuffer(answer.cells.ljust(width, b"\0"), dtype=np.uint8) for answer in answers],
            problems=json.dumps([answer.problem for answer in answers]),
        )


def _answer(robustness: Any, numbers: list[float], cells: Any, problem: str) -> Answer:
    named: dict[str, Any] = dict(zip(NUMBERS, numbers, strict=True))
    named |= {"high": bool(named["high"]), "flights": int(named["flights"])}
    return Answer(robustness=robustness, cells=cells.tobytes() if named["flights"] else b"", problem=problem, **named)
