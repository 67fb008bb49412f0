"""Keeps finished pieces of a campaign on disk, so that it goes on where it was interrupted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from rtsim.errors import InputError, OutputError
from rtsim.outside import LARGEST_TEXT, read_arrays, read_bytes, understanding
from rtsim.whole_file import whole_file, write_whole
from scenarios.campaign.chunks import Chunk, ChunkResult

IDENTITY_FILE = "campaign.json"
LARGEST_PIECE = 200_000_000
"""Size of the largest piece that is read [bytes]."""


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
        self._folder, self._chunks = folder, folder / "chunks"
        self._laws, self._values = len(identity["laws"]), len(identity["metrics"])
        try:
            self._chunks.mkdir(parents=True, exist_ok=True)
            known = None if fresh else self._identity()
            if known is not None and known != identity:
                differing = sorted(key for key in {*known, *identity} if known.get(key) != identity.get(key))
                raise InputError(
                    f"the folder holds another campaign (it differs in {', '.join(differing)})",
                    key="--out",
                    value=str(folder),
                    mend="give another folder, or --fresh to begin anew",
                )
            if fresh:
                self._clear()
            self.write(IDENTITY_FILE, json.dumps(identity, indent=1, sort_keys=True).encode())
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}.") from error

    def load(self, chunk: Chunk) -> ChunkResult | None:
        """Give a piece that is finished, or None; a damaged file counts as not finished.

        Args:
            chunk: The piece.
        """
        path = self._chunks / _name(chunk)
        try:
            data = read_arrays(path, noun="piece of a campaign", largest=LARGEST_PIECE, mend="fly it again")
            with understanding("piece of a campaign", file=path, mend="fly it again"):
                problems = TypeAdapter(tuple[tuple[int, int, str], ...]).validate_json(str(data["problems"].item()))
                metrics = data["metrics"].astype(np.float64, casting="same_kind")
                seconds = data["seconds"].astype(np.float64, casting="same_kind")
        except InputError:
            return None
        shape = (chunk.count, self._laws, self._values)
        if metrics.shape != shape or seconds.shape != shape[1:2] or any(law >= self._laws for _, law, _ in problems):
            return None
        return ChunkResult(chunk, metrics, problems, seconds)

    def save(self, result: ChunkResult) -> None:
        """Keep a finished piece.

        Args:
            result: The piece.

        Raises:
            OutputError: It cannot be written.
        """
        path = self._chunks / _name(result.chunk)
        with whole_file(path) as temporary, temporary.open("wb") as stream:
            np.savez(
                stream,
                metrics=result.metrics,
                seconds=result.seconds,
                problems=np.array(json.dumps(result.problems)),
            )

    def write(self, name: str, content: bytes) -> Path:
        """Write a file of the campaign, whole or not at all.

        Args:
            name: Its name in the folder.
            content: What it holds.

        Returns:
            Its path.
        """
        path = self._folder / name
        write_whole(path, content)
        return path

    def _identity(self) -> Any:
        """What the folder says of itself; None where nothing is in it."""
        path, mend = self._folder / IDENTITY_FILE, "give another folder, or --fresh to begin anew"
        if not path.exists():
            if not any(self._chunks.glob("*.npz")):
                return None
            raise InputError("is missing beside pieces of a campaign", file=str(path), mend=mend)
        data = read_bytes(path, noun="campaign's identity", largest=LARGEST_TEXT, missing=mend)
        with understanding("campaign's identity", file=path, mend=mend):
            return TypeAdapter(dict[str, Any]).validate_python(json.loads(data.decode("utf-8-sig")))

    def _clear(self) -> None:
        for path in self._chunks.glob("*.npz"):
            path.unlink()


def _name(chunk: Chunk) -> str:
    return f"class{chunk.class_number:03d}-run{chunk.first:07d}.npz"
