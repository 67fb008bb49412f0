"""Where a class's numbers come from: a random generator, or a point of the unit cube that a search chooses.

Every draw has a place, such as ``pulses[0][2].amount``: for a generator only the order counts, for a point the place
names its coordinate. A point gives the flights that a campaign draws, with the same probabilities.

Legend:
    place: What is drawn.
    number: The distribution.
    count: How many there are.
    generator: Where numbers are drawn from.
    point: Coordinates by place, 0 to 1.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy.special import ndtri

from scenarios.campaign.spec import Choice, Generator, Normal, Number, Uniform, draw

Kind = Literal["number", "choice", "sign", "seed"]
"""What a coordinate is: a number, one of several, one of two, or the root of the flight's random streams."""
LARGEST_DEVIATION = 3.0
"""Normal distributions are cut at so many deviations."""


class Chance(Protocol):
    """Draws."""

    attempts: int
    """Starts that may be drawn before a class is said to have none."""

    def number(self, place: str, number: Number) -> float:
        """Draw from a distribution; a constant is itself."""
        ...

    def share(self, place: str) -> float:
        """Draw evenly from 0 to 1."""
        ...

    def index(self, place: str, count: int) -> int:
        """Draw one of several."""
        ...

    def seed(self, place: str) -> int:
        """Draw the root of random streams."""
        ...


class RandomChance:
    """Draws from a generator, in the order asked."""

    attempts = 200

    def __init__(self, generator: Generator) -> None:
        """Take the generator."""
        self._generator = generator

    def number(self, place: str, number: Number) -> float:
        """See :class:`Chance`."""
        del place
        return draw(number, self._generator)

    def share(self, place: str) -> float:
        """See :class:`Chance`."""
        del place
        return float(self._generator.random())

    def index(self, place: str, count: int) -> int:
        """See :class:`Chance`."""
        del place
        return int(self._generator.integers(count))

    def seed(self, place: str) -> int:
        """See :class:`Chance`."""
        del place
        return int(self._generator.integers(2**62))


class PointChance:
    """Reads a point: each place its coordinate, from 0 to 1; what it does not say is in the middle."""

    attempts = 1

    def __init__(self, point: Mapping[str, float]) -> None:
        """Take the point."""
        self._point = point

    def number(self, place: str, number: Number) -> float:
        """See :class:`Chance`."""
        return number_at(number, self._at(place)) if is_drawn(number) else draw(number, _NOBODY)

    def share(self, place: str) -> float:
        """See :class:`Chance`."""
        return self._at(place)

    def index(self, place: str, count: int) -> int:
        """See :class:`Chance`."""
        return min(int(self._at(place) * count), count - 1)

    def seed(self, place: str) -> int:
        """See :class:`Chance`."""
        return zlib.crc32(np.float64(self._at(place)).tobytes())

    def _at(self, place: str) -> float:
        return self._point.get(place, 0.5)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One dimension of a class."""

    place: str
    """What is drawn."""
    kind: Kind
    """What it is."""


class RecordingChance:
    """Notes every place that may be asked for: counts at their largest, everything else in its middle."""

    attempts = 0

    def __init__(self) -> None:
        """Begin with nothing noted."""
        self.found: dict[str, Coordinate] = {}

    def number(self, place: str, number: Number) -> float:
        """See :class:`Chance`."""
        if not is_drawn(number):
            return draw(number, _NOBODY)
        self._note(place, "choice" if isinstance(number, Choice) else "number")
        return number_at(number, 1.0 if place.endswith(".count") else 0.5)

    def share(self, place: str) -> float:
        """See :class:`Chance`."""
        self._note(place, "sign")
        return 0.5

    def index(self, place: str, count: int) -> int:
        """See :class:`Chance`."""
        if count > 1:
            self._note(place, "choice")
        return 0

    def seed(self, place: str) -> int:
        """See :class:`Chance`."""
        self._note(place, "seed")
        return 0

    def _note(self, place: str, kind: Kind) -> None:
        self.found.setdefault(place, Coordinate(place, kind))


_NOBODY = np.random.Generator(np.random.PCG64(0))
"""Asked for nothing: constants draw nothing."""


def is_drawn(number: Number) -> bool:
    """Whether something is a distribution of more than one value.

    Args:
        number: A constant or a distribution.
    """
    if isinstance(number, Uniform):
        return number.uniform[0] != number.uniform[1]
    if isinstance(number, Normal):
        return number.normal[1] != 0.0
    return isinstance(number, Choice) and len(set(number.choice)) > 1


def number_at(number: Number, share: float) -> float:
    """The value below which a share of a distribution lies.

    Args:
        number: A distribution.
        share: 0 to 1.
    """
    if isinstance(number, Uniform):
        low, high = number.uniform
        return low + (high - low) * share
    if isinstance(number, Normal):
        mean, deviation = number.normal
        return mean + deviation * float(np.clip(ndtri(share), -LARGEST_DEVIATION, LARGEST_DEVIATION))
    if isinstance(number, Choice):
        weights = np.ones(len(number.choice)) if number.weights is None else np.array(number.weights)
        place = int(np.searchsorted(np.cumsum(weights) / weights.sum(), share, side="right"))
        return number.choice[min(place, len(number.choice) - 1)]
    return number
