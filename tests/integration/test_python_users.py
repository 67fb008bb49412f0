"""What a Python user sees: objects in a line, mistakes in a sentence."""

from __future__ import annotations

import pytest

import rtsim
import scenarios
from rtsim.errors import InputError
from rtsim.realtime.control import checked_speed
from scenarios.files.options import Overrides


def test_objects_show_themselves_in_a_line() -> None:
    aircraft = rtsim.load_aircraft()
    assert len(repr(aircraft.database)) < 300
    assert len(repr(aircraft)) < 400
    assert "17 states" in repr(aircraft)
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(duration=1.0))
    assert len(repr(flight)) < 300
    assert "hover: 250 frames" in repr(flight)


def test_degrees_and_words_are_told() -> None:
    with pytest.raises(InputError, match=r"nacelle=deg\(75\)"):
        rtsim.load_aircraft().trim(airspeed=50.0, nacelle=75.0)
    with pytest.raises(InputError, match="choose a value"):
        checked_speed("fast")  # type: ignore[arg-type]
