"""A folder in which long work keeps what is finished, and says whose it is, so that it can go on after a stop."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from rtsim.errors import InputError, OutputError
from rtsim.outside import LARGEST_TEXT, read_arrays, read_bytes, understanding
from rtsim.whole_file import whole_file, write_whole

LARGEST_PIECE = 200_000_000
"""Size of the largest piece that is read [bytes]."""


class KeptFolder:
    """A folder of finished pieces; each file appears whole or not at all."""

    def __init__(self, folder: Path, identity: dict[str, Any], *, noun: str, pieces: str, fresh: bool = False) -> None:
        """Open or begin a folder.

        Args:
            folder: Where.
            identity: What makes this work this one.
            noun: What the work is called: ``campaign``, also the name of the file that says whose the folder is.
            pieces: Name of the folder of its pieces.
            fresh: Throw finished pieces of another one away.

        Raises:
            InputError: The folder holds another one, or does not say which.
            OutputError: It cannot be written.
        """
        self._folder, self._pieces, self._noun = folder, folder / pieces, noun
        self._file = f"{noun}.json"
        try:
            self._pieces.mkdir(parents=True, exist_ok=True)
            known = None if fresh else self._identity()
            if known is not None and known != identity:
                differing = sorted(key for key in {*known, *identity} if known.get(key) != identity.get(key))
                raise InputError(
                    f"the folder holds another {noun} (it differs in {', '.join(differing)})",
                    key="--out",
                    value=str(folder),
                    mend="give another folder, or --fresh to begin anew",
                )
            if fresh:
                for path in self._pieces.glob("*.npz"):
                    path.unlink()
            self.write(self._file, json.dumps(identity, indent=1, sort_keys=True).encode())
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}.") from error

    def load(self, name: str) -> dict[str, npt.NDArray[Any]] | None:
        """Arrays of a finished piece; None where there is none, or it is damaged.

        Args:
            name: The piece.
        """
        try:
            return read_arrays(
                self._pieces / f"{name}.npz",
                noun=f"piece of a {self._noun}",
                largest=LARGEST_PIECE,
                mend="fly it again",
            )
        except InputError:
            return None

    def save(self, name: str, **arrays: npt.ArrayLike) -> None:
        """Keep a finished piece.

        Args:
            name: The piece.
            arrays: What it holds.

        Raises:
            OutputError: It cannot be written.
        """
        with whole_file(self._pieces / f"{name}.npz") as temporary, temporary.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]  # of its own options none is meant

    def write(self, name: str, content: bytes) -> Path:
        """Write a file of the work, whole or not at all.

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
        path, mend = self._folder / self._file, "give another folder, or --fresh to begin anew"
        if not path.exists():
            if not any(self._pieces.glob("*.npz")):
                return None
            raise InputError(f"is missing beside pieces of a {self._noun}", file=str(path), mend=mend)
        data = read_bytes(path, noun=f"{self._noun}'s identity", largest=LARGEST_TEXT, missing=mend)
        with understanding(f"{self._noun}'s identity", file=path, mend=mend):
            return TypeAdapter(dict[str, Any]).validate_python(json.loads(data.decode("utf-8-sig")))
