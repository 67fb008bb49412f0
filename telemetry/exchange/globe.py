"""Where a flight is on the globe, a sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rtsim.errors import InputError
from rtsim.units import deg

METRES_PER_DEGREE = 6_371_000.0 * math.pi / 180.0
"""Length of a degree of latitude on a sphere [m]."""


@dataclass(frozen=True, slots=True)
class HomePosition:
    """Where the flight begins on the globe: the XV-15 flew at NASA's Crows Landing field."""

    latitude_deg: float = 37.4080
    """North positive [deg]."""
    longitude_deg: float = -121.1090
    """East positive [deg]."""
    altitude_m: float = 0.0
    """Ground elevation above mean sea level [m]; 0 because the model flies in sea-level air at every height."""
    heading_deg: float = 0.0
    """True heading at the start [deg]."""

    @classmethod
    def parse(cls, text: str, *, key: str = "--origin") -> HomePosition:
        """Read ``LAT,LON`` or ``LAT,LON,HEIGHT``.

        Args:
            text: What the user wrote: degrees, north and east positive; metres above mean sea level.
            key: The option it was given to, for the message.

        Raises:
            InputError: It is no such place.
        """
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        within = (90.0, 180.0, 9000.0)
        if len(numbers) not in {2, 3} or not all(abs(n) <= most for n, most in zip(numbers, within, strict=False)):
            raise InputError(
                "is no place on the globe",
                key=key,
                value=text,
                allowed="LAT,LON or LAT,LON,HEIGHT: latitude -90 to 90, longitude -180 to 180, height up to 9000 m",
                mend="write for example 63.976,-22.6054,45",
            )
        return cls(*numbers)

    def place(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude of a place near the start [deg]; longitude from -180 up to 180.

        Args:
            north_m: Way to the north [m].
            east_m: Way to the east [m].
        """
        metres_east = METRES_PER_DEGREE * max(math.cos(deg(self.latitude_deg)), 0.01)
        longitude = self.longitude_deg + east_m / metres_east
        return self.latitude_deg + north_m / METRES_PER_DEGREE, (longitude + 180.0) % 360.0 - 180.0
