"""Tables of TOML files whose keys are options of a flight, made from the declaration in ``rtsim.loop.options``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field

from rtsim.loop.options import Option, declared


def table_fields(options: Iterable[Option], *, number: Any = None) -> dict[str, Any]:
    """Fields for ``pydantic.create_model``: in the options' units, with their ranges, None where a key is not given.

    Args:
        options: The options.
        number: What may stand for a number that need not be whole; None: a number within the option's range.
    """
    drawn = number is not None
    return {item.key: ((number if drawn and item.is_number else _checked(item)) | None, None) for item in options}


def _checked(item: Option) -> Any:
    """What pydantic is to check of a value."""
    if item.is_list:
        return list[get_args(item.kind)[0]]  # type: ignore[misc]
    if item.choices or item.kind is bool:
        return item.kind
    if item.kind is str:
        return Annotated[str, Field(pattern=item.pattern or None, max_length=item.longest)]
    return Annotated[item.kind, Field(ge=item.low, le=item.high, allow_inf_nan=False if item.is_number else None)]


def given(table: BaseModel, file: str = "") -> dict[str, Any]:
    """What a checked table says of a flight's options, by field and in SI.

    Args:
        table: The table; those of its keys that are no options mean nothing here.
        file: The file it stands in; files that it names lie beside it.
    """
    found = {}
    for item in declared().values():
        value = getattr(table, item.key, None)
        if value is not None:
            beside = item.is_file and value
            found[item.name] = str((Path(file).parent / value).resolve()) if beside else item.inside(value)
    return found
