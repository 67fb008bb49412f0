"""Keeps finished pieces of a campaign on disk, so that it goes on where it was interrupted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from rtsim.errors import InputError
from rtsim.outside import understanding
from scenarios.campaign.chunks import Chunk, ChunkResult
from scenarios.campaign.kept_folder import KeptFolder


class Store:
    """A folder of finished pieces; each file appears whole or not at all."""

    def __init__(self, folder: Path, identity: dict[str, Any], *, fresh: bool = False) -> None:
        """Open or begin a folder.

        Args:
            folder: Where.
            identity: What makes this campaign this one: file, seed, laws, plant, database, versions.
            fresh: Throw finished pieces of another campaign away.

        Raises:
            InputError: The folder holds another campaign, or does not say which.
            OutputError: It cannot be written.
        """
        self._kept = KeptFolder(folder, identity, noun="campaign", pieces="chunks", fresh=fresh)
        self._laws, self._values = len(identity["laws"]), len(identity["metrics"])
        self._properties = len(identity["properties"])

    def load(self, chunk: Chunk) -> ChunkResult | None:
        """Give a piece that is finished, or None; a damaged file counts as not finished.

        Args:
            chunk: The piece.
        """
        data = self._kept.load(_name(chunk))
        if data is None:
            return None
        try:
            with understanding("piece of a campaign", file=_name(chunk), mend="fly it again"):
                problems = TypeAdapter(tuple[tuple[int, int, str], ...]).validate_json(str(data["problems"].item()))
                metrics = data["metrics"].astype(np.float64, casting="same_kind")
                robustness = data["robustness"].astype(np.float64, casting="same_kind")
                seconds = data["seconds"].astype(np.float64, casting="same_kind")
        except InputError:
            return None
        shape = (chunk.count, self._laws)
        fits = metrics.shape == (*shape, self._values) and robustness.shape == (*shape, self._properties)
        if not fits or seconds.shape != shape[1:] or any(law >= self._laws for _, law, _ in problems):
            return None
        return ChunkResult(chunk, metrics, robustness, problems, seconds)

    def save(self, result: ChunkResult) -> None:
        """Keep a finished piece.

        Args:
            result: The piece.

        Raises:
            OutputError: It cannot be written.
        """
        self._kept.save(
            _name(result.chunk),
            metrics=result.metrics,
            robustness=result.robustness,
            seconds=result.seconds,
            problems=np.array(json.dumps(result.problems)),
        )


def _name(chunk: Chunk) -> str:
    return f"class{chunk.class_number:03d}-run{chunk.first:07d}"
