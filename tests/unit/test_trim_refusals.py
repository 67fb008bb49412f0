"""What is said where there is no trim."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from rtsim.analysis.flight_condition import AskedCondition, no_trim


@pytest.mark.parametrize(
    ("unclosed", "words"),
    [
        ("u", "20 kn at nacelle 0 deg; the forces along the body do not balance; see"),
        ("q", "20 kn at nacelle 0 deg; the pitching moments do not balance; see"),
        ("coning", "20 kn at nacelle 0 deg; coning does not come to rest; see"),
        ("elevator", "20 kn at nacelle 0 deg: the stick would pass its stop; see"),
        ("", "20 kn at nacelle 0 deg; see"),
    ],
)
def test_what_is_missing_is_said_in_words(unclosed: str, words: str) -> None:
    point: Any = SimpleNamespace(unclosed=unclosed, x=[])
    asked = AskedCondition(20.0, 0.0, True, *([None] * 11))  # type: ignore[arg-type]
    assert words in str(no_trim(asked, point))
