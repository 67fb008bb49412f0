"""How a flight is shown in FlightGear: what the user may choose, checked."""

from __future__ import annotations

from rtsim.errors import InputError
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import HomePosition
from telemetry.flightgear.config import DEFAULT_TARGET, KEFLAVIK, WindowConfig


def window_config(
    target: str = DEFAULT_TARGET, *, home: HomePosition | None = None, paced: bool = True
) -> WindowConfig:
    """Settings of the window of a flight.

    Args:
        target: ``HOST:PORT`` where FlightGear listens.
        home: Where the flight begins on the globe; None takes the runway whose scenery FlightGear brings along.
        paced: Whether the flight is paced.

    Raises:
        InputError: The address is wrong, or the flight is flown as fast as it goes.
    """
    refuse_unpaced_window(paced=paced)
    endpoint = Endpoint.parse(target, key="--flightgear", default=DEFAULT_TARGET)
    return WindowConfig(target=endpoint, home=home if home is not None else KEFLAVIK)


def refuse_unpaced_window(*, paced: bool) -> None:
    """Refuse FlightGear in a flight that is flown as fast as it goes: nobody could watch it.

    Args:
        paced: Whether the flight is paced.

    Raises:
        InputError: It is not.
    """
    if not paced:
        raise InputError(
            "FlightGear needs a paced flight",
            key="--speed",
            value="max",
            allowed="multiples of real time",
            mend="leave --flightgear out",
        )
