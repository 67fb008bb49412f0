"""The results in words: numbers, bands, verdicts, one row for each series."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rtsim.validation.check import Check, Result
from rtsim.validation.run import Validation


@dataclass(frozen=True, slots=True)
class SeriesRow:
    """One series in one row."""

    quantity: str
    """What is compared, and where."""
    source: str
    """Source and grade."""
    band: str
    """The band, and whose it is."""
    found: str
    """Range of model less published, or of the model's numbers."""
    verdict: str
    """How many hold."""
    reason: str
    """Likely reason of misses."""


def number(value: float, decimals: int, *, sign: bool = False) -> str:
    """A number in words.

    Args:
        value: The number; NaN is "none".
        decimals: Decimals.
        sign: Show a plus too.
    """
    if math.isnan(value):
        return "none"
    if math.isinf(value):
        return "any" if value > 0.0 else "-any"
    return f"{round(value, decimals) + 0.0:{'+' if sign else ''}.{decimals}f}"


def printed(value: float | None) -> str:
    """A published number as it stands in the data.

    Args:
        value: The number.
    """
    return "" if value is None else f"{value:.10g}"


def band_text(check: Check) -> str:
    """The band of one check, in its unit.

    Args:
        check: The check.
    """
    if check.band is None:
        return ""
    low, high = (number(limit, check.decimals) for limit in check.band)
    if low == high:
        return low
    return f"at least {low}" if high == "any" else f"{low} to {high}"


def series_of(results: Iterable[Result]) -> dict[str, list[Result]]:
    """Results by series, in order.

    Args:
        results: The results.
    """
    found: dict[str, list[Result]] = {}
    for result in results:
        found.setdefault(result.check.series, []).append(result)
    return found


def series_rows(validation: Validation) -> list[SeriesRow]:
    """Every series in one row.

    Args:
        validation: The results.
    """
    return [series_row(results) for results in series_of(validation.results).values()]


def series_row(results: Sequence[Result]) -> SeriesRow:
    """One series in one row.

    Args:
        results: Its results.
    """
    check = results[0].check
    sources = dict.fromkeys(f"{one.check.source} ({one.check.grade})" for one in results)
    missing = [one for one in results if one.status == "misses"]
    reason = missing[0].reason or "not known" if missing else ""
    where = common_condition(results)
    return SeriesRow(
        f"{check.quantity}{', ' if where else ''}{where}", "; ".join(sources), _series_band(results), _found(results),
        verdict(results), reason,
    )  # fmt: skip


def verdict(results: Sequence[Result]) -> str:
    """How many of several hold, in words.

    Args:
        results: The results.
    """
    judged = [one for one in results if one.status in {"holds", "misses"}]
    outside = sum(one.status == "outside" for one in results)
    rest = f", {outside} not judged" if outside and judged else ""
    missing = sum(one.status == "misses" for one in judged)
    if not judged:
        return "not judged" if outside else "reported"
    if not missing:
        return f"holds{rest}"
    return f"misses{'' if len(judged) == 1 else f' {missing} of {len(judged)}'}{rest}"


def common_condition(results: Sequence[Result]) -> str:
    """What the conditions of several results have in common, with the range of what they have not.

    Args:
        results: The results.
    """
    parts = [one.check.condition.split(", ") for one in results]
    shared = [part for part in parts[0] if all(part in other for other in parts)]
    if len(results) == 1:
        return ", ".join(parts[0])
    first = [part for part in parts[0] if part not in shared]
    last = [part for part in parts[-1] if part not in shared]
    if len(first) == len(last) == 1:
        return ", ".join([*shared, f"{first[0]} to {last[0]}"])
    return ", ".join(shared)


def _series_band(results: Sequence[Result]) -> str:
    """The band as it was declared: about the published number, as a share of it, or as limits."""
    texts = dict.fromkeys(_declared(one.check) for one in results if one.check.band is not None)
    if not texts:
        return "none"
    whose = "; ours" if any(one.check.band_from == "ours" for one in results) else ""
    return (next(iter(texts)) if len(texts) == 1 else "by condition") + whose


def _declared(check: Check) -> str:
    assert check.band is not None
    low, high = check.band
    unit = f" {check.unit}" if check.unit else ""
    if check.compared == "value" or check.published is None:
        return f"{band_text(check)}{unit}"
    if check.compared == "ratio":
        ends = sorted(100.0 * (limit / check.published - 1.0) for limit in (low, high))
        return _about(ends[0], ends[1], " %")
    return _about(low - check.published, high - check.published, unit)


def _about(low: float, high: float, unit: str) -> str:
    if abs(low + high) < 1e-6:
        return f"±{high:.4g}{unit}"
    return f"{low:+.4g} to {high:+.4g}{unit}"


def _found(results: Sequence[Result]) -> str:
    numbers = [one for one in results if math.isfinite(one.value)]
    none = len(results) - len(numbers)
    rest = f"; none at {none}" if none and numbers else ""
    if not numbers:
        return "none"
    check = next((one.check for one in numbers if one.check.band is not None), numbers[0].check)
    unit = f" {check.unit}" if check.unit else ""
    if check.published is None or check.compared == "value":
        return _range([one.value for one in numbers], check.decimals, sign=False) + unit + rest
    pairs = [(one.value, one.check.published) for one in numbers if one.check.published is not None]
    if check.compared == "ratio":
        shares = [100.0 * (value / published - 1.0) for value, published in pairs]
        return _range(shares, 1, sign=True) + " %" + rest
    differences = [value - published for value, published in pairs]
    return _range(differences, check.decimals, sign=True) + unit + rest


def _range(values: Sequence[float], decimals: int, *, sign: bool) -> str:
    low, high = number(min(values), decimals, sign=sign), number(max(values), decimals, sign=sign)
    return low if low == high else f"{low} to {high}"
