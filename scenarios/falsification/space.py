"""What can be varied in a class of flights: its draws as the coordinates of a unit cube."""

from __future__ import annotations

from dataclasses import dataclass

from rtsim.arrays import FloatArray
from rtsim.loop.options import FlightOptions
from scenarios.campaign.chance import Coordinate, PointChance, RecordingChance
from scenarios.campaign.draws import plan_by
from scenarios.campaign.spec import CampaignFile, ClassTable
from scenarios.campaign.trial import FlightPlan


@dataclass(frozen=True, slots=True)
class ClassSpace:
    """A class as a unit cube; a uniform point of it is a flight as a campaign draws it."""

    number: int
    """Place of the class in the campaign."""
    name: str
    """Its name."""
    coordinates: tuple[Coordinate, ...]
    """What is varied, in the order of a vector's numbers."""

    @property
    def size(self) -> int:
        """Dimensions."""
        return len(self.coordinates)

    def plan(self, spec: CampaignFile, vector: FloatArray, options: FlightOptions | None = None) -> FlightPlan:
        """The flight of a point.

        Args:
            spec: The campaign.
            vector: The point, shape (size,), 0 to 1.
            options: What all flights have in common; None: what the campaign's file says.

        Raises:
            NoStart: Its start lies outside the corridor or has no trim.
        """
        places = (coordinate.place for coordinate in self.coordinates)
        return plan_by(PointChance(dict(zip(places, vector.tolist(), strict=True))), spec, self.number, options)


def class_spaces(spec: CampaignFile) -> list[ClassSpace]:
    """The cubes of a campaign's classes.

    Args:
        spec: The campaign.
    """
    found = []
    for number, item in enumerate(spec.classes):
        chance = RecordingChance()
        plan_by(chance, spec, number)
        idle = _idle(item)
        coordinates = tuple(one for place, one in chance.found.items() if place not in idle)
        found.append(ClassSpace(number, item.name, coordinates))
    return found


def _idle(item: ClassTable) -> set[str]:
    """Places that change nothing in this class."""
    found = set()
    if item.turbulence_kt == 0.0 and not item.pilot.noise:
        found.add("seed")
    if item.pilot.yields in {0.0, 1.0}:
        found.add("pilot.yields")
    if item.pilot.yields == 0.0:
        found.add("pilot.reaction_s")
    return found
