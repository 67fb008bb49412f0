"""What a check is, and what comes out of one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rtsim.validation.bench import Bench
    from rtsim.validation.published import Number

Status = Literal["holds", "misses", "reported", "outside"]
Band = tuple[float, float]
Measure = Callable[["Bench"], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One published number and how the model is asked for it."""

    id: str
    """Its name: group, series and condition."""
    series: str
    """The series it belongs to: one quantity of one source."""
    group: str
    """The section of the report."""
    quantity: str
    """What is compared."""
    unit: str
    """Unit of ``value``, ``published`` and ``band``; empty for pure numbers."""
    decimals: int
    """Decimals that the solvers' tolerances make repeatable."""
    condition: str
    """At which flight condition."""
    measure: Measure
    """The model's number; NaN where it has no such condition."""
    source: str
    """Where the published number stands, with the codes of ``[sources]``."""
    grade: str
    """How the published number is known, see ``published.GRADES``."""
    published: float | None = None
    """The published number."""
    place: str = ""
    """Where it stands in ``data/published.toml``."""
    band: Band | None = None
    """Least and largest value that hold; None: reported, not judged."""
    band_from: Literal["printed", "ours", ""] = ""
    """Whether the band stands in the data, or was chosen by us before the model ran."""
    compared: Literal["difference", "ratio", "value"] = "difference"
    """How the band is meant: about the published number, as a share of it, or as limits of the model's number."""
    reason: str = ""
    """Likely reason of a miss."""
    outside: str = ""
    """Why the number is not judged; empty: it is."""
    x: float = math.nan
    """The abscissa within its series."""

    def judged(self, value: float) -> Result:
        """The verdict on a value of the model.

        Args:
            value: As measured.
        """
        if math.isfinite(value):
            value = round(value, self.decimals) + 0.0  # no negative zero
        if self.outside:
            status: Status = "outside"
        elif self.band is None:
            status = "reported"
        else:
            low, high = self.band
            margin = 1e-9 * max(abs(low), abs(high)) if math.isfinite(low + high) else 0.0
            status = "holds" if low - margin <= value <= high + margin else "misses"
        return Result(self, value, status)


@dataclass(frozen=True, slots=True)
class Result:
    """A check and the model's number."""

    check: Check
    """The check."""
    value: float
    """The model's number, rounded; NaN where there is none."""
    status: Status
    """The verdict."""

    @property
    def reason(self) -> str:
        """Why it misses or is not judged; empty where it holds."""
        if self.status == "holds":
            return ""
        return self.check.outside or self.check.reason

    def to_json(self) -> dict[str, Any]:
        """The result by key; what is not finite is null."""
        check = self.check
        band = None if check.band is None else [_finite(limit) for limit in check.band]
        return {
            "id": check.id,
            "group": check.group,
            "quantity": check.quantity,
            "unit": check.unit,
            "source": check.source,
            "grade": check.grade,
            "condition": check.condition,
            "published": check.published,
            "place": check.place,
            "band": band,
            "band_from": check.band_from,
            "value": _finite(self.value),
            "status": self.status,
            "holds": {"holds": True, "misses": False}.get(self.status),
            "reason": self.reason,
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """What the checks of one quantity and source have in common."""

    name: str
    """Begins the names of its checks: ``group.series``."""
    quantity: str
    """What is compared."""
    unit: str = ""
    """Unit."""
    decimals: int
    """Decimals shown."""
    reason: str = ""
    """Likely reason of a miss."""

    def check(
        self,
        label: str,
        condition: str,
        measure: Measure,
        *,
        number: Number | None = None,
        source: str = "",
        grade: str = "",
        scale: float = 1.0,
        absolute: Band | None = None,
        relative: Band | None = None,
        limits: Band | None = None,
        band_from: Literal["printed", "ours", ""] = "",
        outside: str = "",
        x: float = math.nan,
    ) -> Check:
        """Declare one check.

        Args:
            label: Ends its name; empty for a series of one.
            condition: In words.
            measure: Asks the model.
            number: What is published.
            source: Its source, where no number is.
            grade: Its grade, where no number is.
            scale: Factor from the printed number to the unit.
            absolute: Band of model minus published.
            relative: Band of model over published, less one.
            limits: Band of the model's number itself.
            band_from: Where the band is from.
            outside: Why it is not judged.
            x: Abscissa within the series.
        """
        compared: Literal["difference", "ratio", "value"] = "difference"
        published = None if number is None else number.value if scale == 1.0 else round(scale * number.value, 6)
        band = limits
        if published is not None and absolute is not None:
            band = (published + absolute[0], published + absolute[1])
        elif published is not None and relative is not None:
            low, high = sorted((published * (1.0 + relative[0]), published * (1.0 + relative[1])))
            band, compared = (low, high), "ratio"
        if published is None or limits is not None:
            compared = "value"
        return Check(
            id=f"{self.name}.{label}" if label else self.name,
            series=self.name,
            group=self.name.split(".")[0],
            quantity=self.quantity,
            unit=self.unit,
            decimals=self.decimals,
            condition=condition,
            measure=measure,
            source=source or ("" if number is None else number.source),
            grade=grade or ("" if number is None else number.grade),
            published=published,
            place="" if number is None else number.place,
            band=band,
            band_from=band_from if band is not None else "",
            compared=compared,
            reason=self.reason,
            outside=outside,
            x=x,
        )


def knots(airspeed: float) -> str:
    """An airspeed in words.

    Args:
        airspeed: Airspeed [kn].
    """
    return f"{airspeed:g} kn"


def both_ways(size: float) -> Band:
    """A band symmetric about zero.

    Args:
        size: Its half width.
    """
    return (-size, size)


def worst(results: Iterable[Result]) -> Status:
    """The verdict on several.

    Args:
        results: The results.
    """
    found = {result.status for result in results}
    order: tuple[Status, ...] = ("misses", "holds", "reported", "outside")
    return next(status for status in order if status in found)
