"""Tables of a scenario file for scripted misuse and for tests of envelope protection."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rtsim.choices import Leavable
from rtsim.loop.script import Channel, Shape
from rtsim.strict import Strict

Finite = Annotated[float, Field(allow_inf_nan=False)]


class PulseTable(Strict):
    """One of ``[[pulses]]``: what a hand does to a control besides the pilot."""

    channel: Channel
    time_s: Annotated[float, Field(ge=0.0, le=36_000.0, allow_inf_nan=False)]
    duration_s: Annotated[float, Field(gt=0.0, le=36_000.0, allow_inf_nan=False)]
    amount: Annotated[float, Field(ge=-12.0, le=12.0, allow_inf_nan=False)]
    shape: Shape = "step"
    period_s: Annotated[float, Field(ge=0.05, le=600.0, allow_inf_nan=False)] = 1.0
    replaces: bool = False


class TrialExpectTable(Strict):
    """One of ``[[trial.expect]]``: a metric of the trial or the robustness of a property, and its limits."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    metric: str | None = None
    property: str | None = None
    of: Literal["law", "off", "difference"] = "law"
    min: Finite | None = None
    max: Finite | None = None


class TrialTable(Strict):
    """``[trial]``: the scenario is a test of envelope protection, flown with a law and, with the same seed, without."""

    kind: Literal["nominal", "misuse", "failure", "unprotectable"]
    law: Annotated[str | None, Field(max_length=200)] = None
    off_leaves: list[Leavable] = []
    off_depth_kt: Annotated[float, Field(ge=0.0, le=300.0)] = 0.0
    no_harm_height_m: Annotated[float, Field(ge=0.0, le=1000.0)] = 30.0
    expect: Annotated[list[TrialExpectTable], Field(max_length=1000)] = []
