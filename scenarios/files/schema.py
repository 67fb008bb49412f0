"""What a scenario file may say: the TOML layout as strict pydantic models.

Every number has its unit in its key and its range here; unknown keys are errors. ``docs/scenarios.md`` explains the
layout for people, ``scenarios.files.loader`` turns a checked file into a
:class:`~scenarios.files.scenario.Scenario` in SI.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, create_model

from rtsim.atmosphere.specification import GustAxes, GustShape, Severity
from rtsim.choices import PilotMode
from rtsim.faults.fault import Actuator, Control, EngineRating, FaultKind, Stop
from rtsim.loop.option_tables import table_fields
from rtsim.loop.options import declared
from rtsim.programme import LARGEST_BANK, LARGEST_LATERAL, LARGEST_TURN_RATE
from rtsim.strict import Strict
from rtsim.units import to_deg, to_kt
from scenarios.files.nacelle_laws import AutomaticTable
from scenarios.files.trial_schema import PulseTable, TrialTable

FORMAT = 1
"""Version of the layout; a file states it, so that later layouts can still read it."""

AirspeedKt = Annotated[float, Field(ge=-40.0, le=260.0, allow_inf_nan=False)]
NacelleDeg = Annotated[float, Field(ge=0.0, le=90.0, allow_inf_nan=False)]
AltitudeM = Annotated[float, Field(ge=0.0, le=10_000.0, allow_inf_nan=False)]
WantedAltitudeM = Annotated[float, Field(ge=-5.0, le=10_000.0, allow_inf_nan=False)]
"""Below 0 the pilot presses the wheels onto the ground."""
DurationS = Annotated[float, Field(ge=0.0, le=36_000.0, allow_inf_nan=False)]
AccelerationKtS = Annotated[float, Field(ge=0.1, le=10.0, allow_inf_nan=False)]
NacelleRateDegS = Annotated[float, Field(ge=0.1, le=12.0, allow_inf_nan=False)]
ClimbRateMS = Annotated[float, Field(ge=0.1, le=15.0, allow_inf_nan=False)]
HeadingDeg = Annotated[float, Field(ge=0.0, le=360.0, allow_inf_nan=False)]


def _within(largest: float) -> Any:
    """A number of either sign."""
    return Annotated[float, Field(ge=-largest, le=largest, allow_inf_nan=False)]


BankDeg: Any = _within(round(to_deg(LARGEST_BANK), 6))
TurnRateDegS: Any = _within(round(to_deg(LARGEST_TURN_RATE), 6))
LateralKt: Any = _within(round(to_kt(LARGEST_LATERAL), 6))
TURN_KEYS = ("heading_deg", "bank_deg", "turn_rate_deg_s")
"""What a point may ask of the heading: one of them."""


FlightTable: Any = create_model(
    "FlightTable",
    __base__=Strict,
    __doc__="``[flight]``: who flies what; the command line can override each of these.",
    **table_fields(declared().values()),
)


class StartTable(Strict):
    """``[start]``: the trimmed condition at frame 0; by default the programme's first point."""

    condition: Literal["hover", "conversion", "cruise"] | None = None
    airspeed_kt: AirspeedKt | None = None
    nacelle_deg: NacelleDeg | None = None
    altitude_m: AltitudeM | None = None


class PointTable(Strict):
    """One of ``[[programme.points]]``: where to be, and either when or how fast to get there."""

    airspeed_kt: AirspeedKt
    nacelle_deg: NacelleDeg
    altitude_m: WantedAltitudeM | None = None
    time_s: DurationS | None = None
    acceleration_kt_s: AccelerationKtS | None = None
    nacelle_rate_deg_s: NacelleRateDegS | None = None
    climb_rate_m_s: ClimbRateMS | None = None
    hold_s: DurationS | None = None
    heading_deg: HeadingDeg | None = None
    bank_deg: BankDeg | None = None
    turn_rate_deg_s: TurnRateDegS | None = None
    lateral_kt: LateralKt | None = None
    track: bool | None = None


class ProgrammeTable(Strict):
    """``[programme]``: the points, and the rates that hold for all of them."""

    points: Annotated[list[PointTable], Field(min_length=1, max_length=10_000)]
    nacelle_motion: Literal["spread", "rate"] = "spread"
    acceleration_kt_s: AccelerationKtS = 3.0
    nacelle_rate_deg_s: NacelleRateDegS = 3.0
    climb_rate_m_s: ClimbRateMS = 2.0


GustKt = Annotated[float, Field(ge=-60.0, le=60.0, allow_inf_nan=False)]


class AirGustTable(Strict):
    """One of ``[[air.gusts]]``: a discrete gust."""

    time_s: DurationS
    ahead_kt: GustKt = 0.0
    below_kt: GustKt = 0.0
    lateral_kt: GustKt = 0.0
    shape: GustShape = "one-minus-cosine"
    duration_s: Annotated[float, Field(ge=0.0, le=3600.0, allow_inf_nan=False)] | None = None
    length_m: Annotated[float, Field(ge=0.0, le=100_000.0, allow_inf_nan=False)] | None = None
    axes: GustAxes = "earth"


class AirTable(Strict):
    """``[air]``: turbulence and gusts; calm by default."""

    turbulence: Severity | None = None
    wind_at_20_ft_kt: Annotated[float, Field(ge=0.0, le=60.0, allow_inf_nan=False)] | None = None
    fade_in_s: Annotated[float, Field(ge=0.0, le=60.0, allow_inf_nan=False)] = 2.0
    minimum_speed_kt: Annotated[float, Field(ge=2.0, le=150.0, allow_inf_nan=False)] = 30.0
    lateral: bool = False
    gusts: Annotated[list[AirGustTable], Field(max_length=1000)] = []


class FaultTable(Strict):
    """One of ``[[faults]]``: something fails, and perhaps mends."""

    kind: FaultKind
    time_s: DurationS
    end_s: DurationS | None = None
    actuator: Actuator | None = None
    control: Control | None = None
    rate_deg_s: Annotated[float, Field(ge=0.0, le=200.0, allow_inf_nan=False)] | None = None
    stop: Stop | None = None
    bias_kt: Annotated[float, Field(ge=-100.0, le=100.0, allow_inf_nan=False)] | None = None
    power_shp: Annotated[float, Field(ge=0.0, le=1802.0, allow_inf_nan=False)] | None = None
    other_engine: EngineRating = "contingency"


class EventTable(Strict):
    """One of ``[[events]]``: something that happens at a time."""

    time_s: DurationS
    action: Literal["pilot"]
    pilot: PilotMode


class ExpectTable(Strict):
    """One of ``[[expect]]``: a metric of the flight or the robustness of a property, and its limits."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    metric: str | None = None
    property: str | None = None
    min: Annotated[float, Field(allow_inf_nan=False)] | None = None
    max: Annotated[float, Field(allow_inf_nan=False)] | None = None


class ScenarioFile(Strict):
    """A whole scenario file."""

    format: Literal[1]
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=100)]
    title: Annotated[str, Field(min_length=1, max_length=200)]
    description: str = ""
    duration_s: Annotated[float, Field(gt=0.0, le=36_000.0, allow_inf_nan=False)] | None = None
    flight: FlightTable = FlightTable()  # made from the options' declaration
    reaction_s: Annotated[float, Field(ge=0.0, le=3600.0, allow_inf_nan=False)] | None = None
    start: StartTable = StartTable()
    programme: ProgrammeTable | None = None
    automatic: AutomaticTable | None = None
    air: AirTable = AirTable()
    faults: Annotated[list[FaultTable], Field(max_length=1000)] = []
    pulses: Annotated[list[PulseTable], Field(max_length=1000)] = []
    events: list[EventTable] = []
    expect: list[ExpectTable] = []
    trial: TrialTable | None = None
