"""What a conversion-path search is asked to do: the TOML layout of its specification, checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, create_model

from rtsim.errors import InputError
from rtsim.loop.option_tables import table_fields
from rtsim.loop.options import CONDITION, declared
from rtsim.optimization.path import AccelerationCaps
from rtsim.optimization.paths import FAST_SIDE_CAPS, NEAR_STALL_CAPS, PATH_NAMES
from rtsim.strict import Examined, Strict, checked
from rtsim.toml_file import read_toml

Objective = Literal[
    "flapping_integral",
    "flapping_peak",
    "flapping_rms",
    "stick_effort",
    "lever_effort",
    "stick_travel",
    "duration",
    "corridor_proximity",
    "altitude_excursion",
    "pitch_excursion",
    "energy",
]
PathName = Literal["typical", "near_stall", "centre_line", "centre_line_variable", "fast_side"]
Method = Literal["ga", "cma-es", "nsga2"]
Handling = Literal["feasibility", "penalty"]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Cap = Annotated[float, Field(ge=0.1, le=10.0, allow_inf_nan=False)]


class AccelerationTable(Strict):
    """``[acceleration]``: caps by region; see :class:`rtsim.optimization.path.AccelerationCaps`."""

    above_detent_kt_s: Cap = 3.0
    below_detent_kt_s: Cap = 4.0
    airplane_kt_s: Cap = 5.0
    detent_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 50.0

    def caps(self) -> AccelerationCaps:
        """The caps as the paths take them."""
        return AccelerationCaps(self.above_detent_kt_s, self.below_detent_kt_s, self.airplane_kt_s, self.detent_deg)


class LimitsTable(Strict):
    """``[limits]``: what a path must keep to; each is a constraint of the search."""

    margin_kt: Annotated[float, Field(ge=-20.0, le=60.0)] = 5.0
    altitude_m: Positive = 4.5
    pitch_deg: Positive = 18.0
    airspeed_error_kt: Positive = 4.0
    flapping_deg: Positive = 7.0
    duration_s: Positive | None = None
    mast_torque_inlb: Positive | None = None


class SearchTable(Strict):
    """``[search]``: how to look for it."""

    method: Method = "cma-es"
    generations: Annotated[int, Field(ge=1, le=100_000)] = 40
    population: Annotated[int, Field(ge=4, le=10_000)] = 32
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    handling: Handling = "feasibility"
    start_from: list[PathName] = ["typical", "near_stall", "centre_line", "centre_line_variable", "fast_side"]


_OPTIONS: Any = create_model(
    "_OPTIONS",
    __base__=Strict,
    **table_fields(declared()[name] for name in ("plant", "outer_loop", "corridor", "rate_hz", "database", *CONDITION)),
)


class FlightTable(_OPTIONS):  # type: ignore[misc]  # made from the options' declaration
    """``[flight]``: what flies."""

    altitude_m: Annotated[float, Field(ge=10.0, le=10_000.0)] = 100.0


class RobustTable(Strict):
    """``[robust]``: judge each path by several flights in turbulence, all candidates meeting the same air."""

    flights: Annotated[int, Field(ge=0, le=1000)] = 0
    turbulence: Literal["light", "moderate", "severe"] | None = "moderate"
    pilot_noise: bool = True
    spread_weight: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    altitude_m: Positive = 15.0
    pitch_deg: Positive = 25.0
    airspeed_error_kt: Positive = 25.0
    margin_kt: Annotated[float, Field(ge=-20.0, le=60.0)] = 0.0
    flapping_deg: Positive = 10.0


class SearchSpec(Strict):
    """A whole specification."""

    format: Literal[1] = 1
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=80)] = "best_conversion"
    objectives: Annotated[list[Objective], Field(min_length=1, max_length=4)] = ["flapping_integral"]
    points: Annotated[int, Field(ge=1, le=30)] = 7
    nacelle_rate_deg_s: Annotated[float, Field(ge=0.1, le=12.0)] = 3.0
    nacelle_motion: Literal["rate", "spread"] = "rate"
    hold_s: Annotated[float, Field(ge=0.0, le=60.0)] = 4.0
    acceleration: AccelerationTable = AccelerationTable()
    limits: LimitsTable = LimitsTable()
    search: SearchTable = SearchTable()
    flight: FlightTable = FlightTable()
    robust: RobustTable = RobustTable()


def spec_like(path: str) -> SearchSpec:
    """The constraint set of one of the paper's paths: its nacelle rate, its motion and its acceleration caps.

    Args:
        path: One of ``rtsim.optimization.paths.PATH_NAMES``.

    Raises:
        InputError: There is no such path.
    """
    if path not in PATH_NAMES:
        raise InputError("is not a path", key="--like", value=path, allowed=", ".join(PATH_NAMES))
    caps = {"near_stall": NEAR_STALL_CAPS, "fast_side": FAST_SIDE_CAPS}.get(path, AccelerationCaps())
    rate, motion = 3.0, "rate" if path == "typical" else "spread"
    if path == "centre_line_variable":
        rate, caps = 12.0, AccelerationCaps(4.0, 4.0, 5.0)
    return SearchSpec.model_validate(
        {
            "name": f"best_like_{path}",
            "nacelle_rate_deg_s": rate,
            "nacelle_motion": motion,
            "acceleration": {
                "above_detent_kt_s": caps.above_detent_kt_s,
                "below_detent_kt_s": caps.below_detent_kt_s,
                "airplane_kt_s": caps.airplane_kt_s,
            },
        }
    )


def load_spec(path: str | Path, changes: Mapping[str, Any] | None = None) -> SearchSpec:
    """Read a specification file.

    Args:
        path: The TOML file.
        changes: Values that override the file's, by key: ``points``, ``search.seed``.

    Raises:
        InputError: It does not exist, is no TOML, or has a key or value that is not allowed (the first one found).
    """
    data = read_toml(path, noun="search specification")
    place_database(data, path)
    return checked_spec(data, changes, file=str(path))


def place_database(data: Mapping[str, Any], path: str | Path) -> None:
    """Name the database of a specification by its whole path: it lies beside the file.

    Args:
        data: The tables; changed.
        path: The file.
    """
    flight = data.get("flight")
    if isinstance(flight, dict) and isinstance(flight.get("database"), str) and flight["database"]:
        flight["database"] = str((Path(path).parent / flight["database"]).resolve())


def checked_spec(
    data: Mapping[str, Any], changes: Mapping[str, Any] | None = None, *, file: str | None = None
) -> SearchSpec:
    """Check the content of a specification.

    Args:
        data: The tables.
        changes: Values that override them, by key: ``points``, ``search.seed``.

    Raises:
        InputError: A key or value is not allowed; the first one found.
    """
    spec = checked(SearchSpec, data, file=file)
    if changes:
        whole = spec.model_dump()
        for key, value in changes.items():
            table, _, name = key.rpartition(".")
            (whole[table] if table else whole)[name] = value
        spec = checked(SearchSpec, whole, file=None)
    for problem in _contradictions(spec, file):
        raise problem
    return spec


def spec_problems(data: Mapping[str, Any], *, file: str) -> list[InputError]:
    """All mistakes of a specification file.

    Args:
        data: The tables.
    """
    examined = Examined(SearchSpec, data, file=file)
    examined.ask(lambda spec: _contradictions(spec, file))
    return examined.problems


def _contradictions(spec: SearchSpec, file: str | None) -> list[InputError]:
    """Mistakes that involve more than one key."""
    found = []
    if len(set(spec.objectives)) != len(spec.objectives):
        mend = "name each once"
        found.append(
            InputError("names an objective twice", file=file, key="objectives", value=spec.objectives, mend=mend)
        )
    if len(spec.objectives) > 1 and spec.search.method != "nsga2":
        found.append(
            InputError(
                "cannot minimize several objectives at once",
                file=file,
                key="search.method",
                value=spec.search.method,
                allowed="nsga2",
                mend="choose nsga2 or one objective",
            )
        )
    return found
