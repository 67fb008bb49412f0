"""Things that happen in a trial or do not: what campaigns count and verdicts ask."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from rtsim.arrays import BoolArray, FloatArray
from rtsim.measures.metric_kernels import VALUE
from rtsim.measures.metrics import SECONDARY_LIMITS, TrialMetrics, violations

DEEP_KT = 5.0
"""Depth beyond which an exceedance is major [kn]."""
NUISANCE_MARGIN_KT = 3.0
"""An activation is a nuisance where the unprotected twin kept more than this margin [kn]."""
NO_HARM_HEIGHT = 30.0
"""Height a law may lose beyond what its unprotected twin lost [m]."""
DELAY_S = 0.5
"""Later end of the conversion (``conversion_s``) that counts as a delay [s]."""

EventTest = Callable[[FloatArray, FloatArray], BoolArray]
"""Metrics of protected flights and of their twins, (flights, VALUE.size) each, to whether it happened (flights,)."""


def new_violations(law: TrialMetrics, off: TrialMetrics) -> frozenset[str]:
    """Secondary limits that the protected flight exceeded and its twin did not.

    Args:
        law: The protected flight.
        off: Its unprotected twin.
    """
    return (law.exceeded - off.exceeded) & frozenset(SECONDARY_LIMITS)


def _exceeded(law: FloatArray, off: FloatArray) -> BoolArray:
    del off
    return law[:, VALUE.exceedances] > 0.0


def _deep(law: FloatArray, off: FloatArray) -> BoolArray:
    return _exceeded(law, off) & (law[:, VALUE.depth_kt] > DEEP_KT)


def _activated(law: FloatArray, off: FloatArray) -> BoolArray:
    del off
    return law[:, VALUE.corridor_activations] > 0.0


def _nuisance(law: FloatArray, off: FloatArray) -> BoolArray:
    return _activated(law, off) & (off[:, VALUE.worst_margin_kt] > NUISANCE_MARGIN_KT)


def _violated(name: str) -> EventTest:
    return lambda law, off: violations(law)[name]  # noqa: ARG005 - all events have one form


def _height_harm(law: FloatArray, off: FloatArray) -> BoolArray:
    return law[:, VALUE.height_lost_m] > off[:, VALUE.height_lost_m] + NO_HARM_HEIGHT


def _harmed(law: FloatArray, off: FloatArray) -> BoolArray:
    with_law, without = violations(law), violations(off)
    new = np.zeros(len(law), dtype=np.bool_)
    for name in SECONDARY_LIMITS:
        new |= with_law[name] & ~without[name]
    return new | _height_harm(law, off)


def _delayed(law: FloatArray, off: FloatArray) -> BoolArray:
    return law[:, VALUE.conversion_s] > off[:, VALUE.conversion_s] + DELAY_S


EVENTS: Mapping[str, EventTest] = {
    "exceeded": _exceeded,
    "deep": _deep,
    "activated": _activated,
    "nuisance": _nuisance,
    **{name: _violated(name) for name in SECONDARY_LIMITS},
    "harmed": _harmed,
    "height_harm": _height_harm,
    "delayed": _delayed,
}
"""Events by name: corridor left; left by more than 5 kn; law acted for the corridor; the same needlessly; a secondary
limit exceeded, by name; harm done (height, or a secondary limit its twin kept); 30 m more height lost; conversion
ended more than 0.5 s later."""
