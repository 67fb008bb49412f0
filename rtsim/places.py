"""Places in the arrays of kernels, declared by name: to compiled code, ``FAULT.jammed`` is a number like 1."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


class Places:
    """Names of the places of one array, in order. Knows nothing of numba; ``rtsim.kernels.compiled`` teaches it."""

    def __init__(self, *names: str | tuple[str, int]) -> None:
        """Number the names from 0.

        Args:
            names: Names in the order of the places; with a number, the name of the first of so many places.
        """
        place = 0
        numbers: dict[str, int] = {}
        for item in names:
            name, width = (item, 1) if isinstance(item, str) else item
            assert name not in {*numbers, "size"}, f"{name} is a place already"
            numbers[name] = place
            place += width
        self.__dict__.update(numbers)
        self.size = place
        """How many places there are."""
        self._names = tuple(numbers)

    def __getattr__(self, name: str) -> Any:  # only for names that are not there; tells type checkers that others are
        raise AttributeError(f"there is no place '{name}'; there are {', '.join(self._names)}")

    def __iter__(self) -> Iterator[int]:
        return (self.__dict__[name] for name in self._names)

    def __len__(self) -> int:
        return self.size

    def asdict(self) -> dict[str, int]:
        """Places by name, in order."""
        return {name: self.__dict__[name] for name in self._names}
