"""Keeps finished pieces of a campaign on disk, so that it goes on where it was interrupted."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from rtsim.errors import InputError, OutputError
from rtsim.whole_file import whole_file, write_whole
from scenarios.campaign.chunks import Chunk, ChunkResult

IDENTITY_FILE = "campaign.json"


class Store:
    """A folder of finished pieces; each file appears whole or not at all."""

    def __init__(self, folder: Path, identity: dict[str, Any], *, fresh: bool = False) -> None:
        """Open or begin a folder.

        Args:
            folder: Where.
            identity: What makes this campaign this one: file, seed, laws, plant, database, versions.
            fresh: Throw finished pieces of another campaign away.

        Raises:
            InputError: The folder holds another campaign.
            OutputError: It cannot be written.
        """
        self._folder, self._chunks = folder, folder / "chunks"
        try:
            self._chunks.mkdir(parents=True, exist_ok=True)
            known = self._identity()
            if known is not None and known != identity:
                if not fresh:
                    differing = sorted(key for key in {*known, *identity} if known.get(key) != identity.get(key))
                    raise InputError(
                        f"the folder holds another campaign (it differs in {', '.join(differing)})",
                        key="--out",
                        value=str(folder),
                        mend="give another folder, or --fresh to begin anew",
                    )
                self._clear()
            elif fresh:
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
            with np.load(path, allow_pickle=False) as data:
                problems = json.loads(str(data["problems"]))
                result = ChunkResult(
                    chunk,
                    data["metrics"].copy(),
                    tuple((int(run), int(law), str(text)) for run, law, text in problems),
                    data["seconds"].copy(),
                )
        except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
            return None
        return result if len(result.metrics) == chunk.count else None

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
        try:
            return json.loads((self._folder / IDENTITY_FILE).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return None

    def _clear(self) -> None:
        for path in self._chunks.glob("*.npz"):
            path.unlink()


def _name(chunk: Chunk) -> str:
    return f"class{chunk.class_number:03d}-run{chunk.first:07d}.npz"
