"""What the report says, in order."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rtsim.validation.check import Result
from rtsim.validation.contradictions import Contradiction
from rtsim.validation.declared import GROUPS
from rtsim.validation.markup import Block, Grid, Heading, Paragraph, Picture
from rtsim.validation.plots import FIGURES
from rtsim.validation.published import published_data
from rtsim.validation.run import Validation
from rtsim.validation.sensitivity import Moved, Sensitivity
from rtsim.validation.summary import band_text, number, printed, series_of, series_row, verdict

SENSITIVITY_TITLE = "Sensitivity to what is not known exactly"
_GRADES = (
    "T printed table, T2 printed table transcribed by a third party and not seen by us, X text, F figure read by us, "
    "F2 figure read by a third party, D derived, M from memory, - a requirement of ours or no source."
)


def document(
    validation: Validation, beside: Sequence[Contradiction], moved: Sensitivity | None
) -> list[Block]:  # fmt: skip
    """The whole report.

    Args:
        validation: The checks.
        beside: Sources side by side.
        moved: How far inputs move the checks; None leaves the section out.
    """
    blocks = [*_head(validation), *_overview(validation), *_contradictions(beside)]
    for name, (title, _) in GROUPS.items():
        blocks += _group(title, name, validation)
    if moved is not None:
        blocks += _sensitivity(validation, moved)
    return [*blocks, *_sources()]


def _head(validation: Validation) -> Iterable[Block]:
    counts = validation.counts()
    yield Heading("Validation of the nonlinear XV-15", 1)
    yield Paragraph(
        "Every number that we found published about the XV-15's behaviour, and what the model gives. "
        "Written by `rtsim validate --out DIR --sensitivity`; nothing here is typed by hand. Nothing is fitted: where "
        "the model misses, the miss is stated. The published numbers stand in `rtsim/validation/data/published.toml`, "
        "under the name given beside each; the checks are declared in `rtsim/validation/declared`. What the model is: "
        "`docs/model.md`."
    )
    yield Paragraph(
        f"**{len(validation.results)} numbers: {counts['holds']} hold, {counts['misses']} miss, {counts['reported']} "
        f"are reported without a band, {counts['outside']} are not judged.** A band is printed with the source's data, "
        '("printed"), or was chosen by us before the model ran ("ours"). "none": the model has no such condition.'
    )
    yield Paragraph(f"13 000 lb, sea level, 589 rpm unless stated. Grades of sources: {_GRADES}")


def _overview(validation: Validation) -> Iterable[Block]:
    yield Heading("Overview", 2)
    for name, (title, _) in GROUPS.items():
        rows = [series_row(results) for results in series_of(validation.of_group(name)).values()]
        yield Heading(title, 3)
        yield Grid(
            ("quantity", "source (grade)", "band", "model less published", "verdict", "likely reason"),
            tuple((row.quantity, row.source, row.band, row.found, row.verdict, row.reason) for row in rows),
        )


def _contradictions(beside: Sequence[Contradiction]) -> Iterable[Block]:
    yield Heading("Sources that contradict each other", 2)
    for one in beside:
        yield Heading(f"{one.title}, {one.unit}", 3)
        yield Paragraph(one.remark)
        rows = (
            (words, *("" if math.isnan(value) else number(value, one.decimals) for value in values))
            for words, values in one.rows
        )
        yield Grid(("", *one.columns), tuple(rows))


def _group(title: str, name: str, validation: Validation) -> Iterable[Block]:
    yield Heading(title, 2)
    for figure in FIGURES:
        if figure.group == name:
            yield Picture(figure.stem, figure.title)
    for results in series_of(validation.of_group(name)).values():
        check = results[0].check
        unit = f" [{check.unit}]" if check.unit else ""
        yield Heading(f"{series_row(results).quantity}{unit}: {verdict(results)}", 3)
        sources = "; ".join(dict.fromkeys(f"{one.check.source} ({one.check.grade})" for one in results))
        band = next((one.check.band_from for one in results if one.check.band_from), "")
        words = f"Source: {sources}. {f'Band: {band}.' if band else 'No band: reported.'}"
        reasons = dict.fromkeys(one.reason for one in results if one.reason)
        words += "".join(f" {_sentence(reason)}" for reason in reasons)
        yield Paragraph(f"{words} `{check.series}`")
        yield Grid(
            ("condition", "published", "band", "model", "verdict", "in published.toml"),
            tuple(_point(one) for one in results),
        )


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."


def _point(result: Result) -> tuple[str, ...]:
    check = result.check
    status = "not judged" if result.status == "outside" else result.status
    place = f"`{check.place}`" if check.place else ""
    value = number(result.value, check.decimals)
    return check.condition, printed(check.published), band_text(check), value, status, place


def _sensitivity(validation: Validation, moved: Sensitivity) -> Iterable[Block]:
    yield Heading(SENSITIVITY_TITLE, 2)
    yield Paragraph(
        "Each input goes alone to the low and the high end of a defensible range; the tables give the change of the "
        "model's number there (low / high). A dot: less than the last digit. A star: the verdict is another there. "
        '"none": there is no such condition there, or was none before. Nothing of this is used to choose a value.'
    )
    rows = [
        (one.name, f"`{one.key}`", one.range_text(), one.why, str(len(moved.turned(place))))
        for place, one in enumerate(moved.inputs)
    ]
    yield Grid(("input", "entry", "value: range", "why", "verdicts it changes"), tuple(rows))
    for name, (title, _) in GROUPS.items():
        results = [result for result in validation.of_group(name) if result.check.id in moved.moved]
        if results:
            yield Heading(f"Sensitivity: {title[0].lower()}{title[1:]}", 3)
            yield sensitivity_grid(results, moved)


def sensitivity_grid(results: Sequence[Result], moved: Sensitivity) -> Grid:
    """The table of one group.

    Args:
        results: Its checks.
        moved: The changes.
    """
    head = ("check", "model", *(one.name for one in moved.inputs))
    rows = []
    for result in results:
        check = result.check
        cells = [_cell(pair, check.decimals) for pair in moved.moved[check.id]]
        rows.append((f"`{check.id}`", number(result.value, check.decimals), *cells))
    return Grid(head, tuple(rows))


def _cell(pair: tuple[Moved, Moved], decimals: int) -> str:
    if all(end.change == 0.0 for end in pair):
        return "·"
    return " / ".join(number(end.change, decimals, sign=True) + ("*" if end.turned else "") for end in pair)


def _sources() -> Iterable[Block]:
    yield Heading("Sources", 2)
    yield Grid(("code", "source"), tuple((code, words) for code, words in published_data()["sources"].items()))
