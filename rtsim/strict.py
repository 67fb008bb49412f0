"""Tables of TOML files with exact types: every mistake becomes a sentence with key, value, range and mend."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterable
from typing import Any, Generic, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from rtsim.errors import InputError, closest, suggestion

Table = TypeVar("Table", bound=BaseModel)
_KINDS = {float: "a number", int: "a whole number", str: "a text in quotes", bool: "true or false"}


class Strict(BaseModel):
    """A table of a file: exact types, no unknown keys, read-only."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


def checked(model: type[Table], data: Any, *, file: str | None) -> Table:
    """A table whose every key and value is allowed.

    Args:
        model: What the table may hold.
        data: What it holds.

    Raises:
        InputError: For the first mistake found.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise explain(error, model, file)[0] from None


def explain(error: ValidationError, model: type[BaseModel], file: str | None) -> list[InputError]:
    """Translate everything pydantic found.

    Args:
        error: What validation raised.
        model: The model that was validated.

    Returns:
        One :class:`InputError` per problem, in the order of the file's keys.
    """
    found: dict[str, InputError] = {}
    places = [tuple(part for part in item["loc"] if not _is_union_tag(part)) for item in error.errors()]
    for item, location in zip(error.errors(), places, strict=True):
        if isinstance(item["input"], list) and any(place[:-1] == location for place in places):
            continue  # where a value or a list of them may stand, the entry that is wrong says it
        key = dotted(location)
        found.setdefault(key, _explain_one(item, location, key, model, file))
    return list(found.values())


class Examined(Generic[Table]):
    """A file's content as far as it can be understood, and every mistake found so far."""

    def __init__(self, model: type[Table], data: Any, *, file: str | None) -> None:
        """Check every key and value.

        Args:
            model: What the file may hold.
            data: What it holds.
        """
        self.content: Table
        """The content; what is wrong in it has its default, or is None."""
        self.problems: list[InputError] = []
        """What was found, in the order of the questions."""
        try:
            self.content = model.model_validate(data)
        except ValidationError as error:
            self.problems = explain(error, model, file)
            wrong = {tuple(p for p in item["loc"] if not _is_union_tag(p)) for item in error.errors()}
            self.content = _lenient(model, data if isinstance(data, dict) else {}, (), wrong)

    def ask(self, *checks: Callable[[Table], list[InputError]]) -> None:
        """Look for more mistakes: where there are some already, only for those that do not follow from them.

        Args:
            checks: Each finds mistakes in the content.
        """
        known = [problem.key or "" for problem in self.problems]
        for check in checks:
            try:
                found = check(self.content)
            except Exception:  # of what is wrong already, a check may stumble over the pieces
                if not known:
                    raise
                continue
            self.problems += [item for item in found if not any(_related(item.key or "", key) for key in known)]


def _related(one: str, other: str) -> bool:
    """Whether two keys are the same, or one stands within the other."""
    short, long = sorted((one, other), key=len)
    return bool(short) and long.startswith(short) and long[len(short) :][:1] in {"", ".", "["}


def _lenient(
    model: type[Table], data: dict[str, Any], place: tuple[str | int, ...], wrong: set[tuple[str | int, ...]]
) -> Table:
    """A table from whatever of it is right."""
    values = {}
    for name, field in model.model_fields.items():
        missing = None if field.is_required() else field.get_default(call_default_factory=True)
        here = (*place, name)
        values[name] = _lenient_value(field.annotation, data[name], here, wrong) if name in data else missing
        if values[name] is None:
            values[name] = missing
    return model.model_construct(**values)


def _lenient_value(annotation: Any, value: Any, place: tuple[str | int, ...], wrong: set[tuple[str | int, ...]]) -> Any:
    tables = _tables_in(annotation)
    if isinstance(value, dict) and tables:
        fitting = max(tables, key=lambda table: len(set(table.model_fields) & set(value)))
        return _lenient(fitting, value, place, wrong)
    if isinstance(value, list) and tables:
        return [_lenient_value(annotation, item, (*place, number), wrong) for number, item in enumerate(value)]
    return None if any(other[: len(place)] == place for other in wrong) else value


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    found = []
    for branch in _branches(annotation):
        if isinstance(branch, type) and issubclass(branch, BaseModel):
            found.append(branch)
        else:
            found += [table for inner in get_args(branch) for table in _tables_in(inner)]
    return found


def dotted(location: Iterable[str | int]) -> str:
    """Spell a place in a TOML file, such as ``programme.points[2].airspeed_kt``.

    Args:
        location: Keys and list positions from the top of the file.
    """
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def _is_union_tag(part: str | int) -> bool:
    """Pydantic puts the branch of a union ('float', 'constrained-str', 'literal[...]') into the location."""
    return isinstance(part, str) and ("[" in part or part in {"float", "int", "str", "bool", "none"})


def _explain_one(
    item: Any, location: tuple[str | int, ...], key: str, model: type[BaseModel], file: str | None
) -> InputError:
    kind: str = item["type"]
    if kind == "missing":
        allowed = _allowed(_field(model, location))
        return InputError("is missing", file=file, key=key, allowed=allowed, mend="add it")
    if kind == "extra_forbidden":
        table = _model(model, location[:-1])
        names = closest(str(location[-1]), table.model_fields if table else ())
        return InputError(
            "is not a known key",
            file=file,
            key=key,
            allowed=", ".join(sorted(names)),
            mend=suggestion(str(location[-1]), names, otherwise="delete it"),
        )
    field = _field(model, location)
    allowed = _allowed(field) or _limit(item.get("ctx", {}))
    value = item.get("input")
    if isinstance(value, dict | list) and not (kind.startswith("too_") or kind.endswith("_short")):
        value = f"a {'table' if isinstance(value, dict) else 'list'}"
    if kind in {"literal_error", "string_pattern_mismatch"}:
        problem, mend = "is not one of the choices" if kind == "literal_error" else "is misspelled", "choose one"
        choices = _choices(field)
        if choices and isinstance(value, str):
            mend = suggestion(value, [str(choice) for choice in choices], otherwise="choose one")
        elif kind == "literal_error":
            allowed = allowed or str(item["ctx"]["expected"])  # an entry of a list
        else:
            allowed, mend = f"the pattern {item['ctx']['pattern']}", "correct the value"
    elif kind.startswith(("greater_than", "less_than", "finite")):
        problem, mend = "is out of range", "choose a value in this range"
    elif kind.endswith(("_type", "_parsing", "_from_float")):
        problem, mend = f"must be {_wanted(kind, field)}", "correct the value"
    elif kind.startswith(("too_short", "string_too_short")):
        problem, mend, value = "is empty", "add to it", None
    else:
        problem, mend = str(item["msg"]).lower().rstrip("."), "correct the value"
    return InputError(problem, file=file, key=key, value=value, allowed=allowed, mend=mend)


def _wanted(kind: str, field: FieldInfo | None) -> str:
    if kind.startswith(("model", "dict")):
        return "a table"
    if kind.startswith("list"):
        return "a list"
    for annotation in _branches(field.annotation if field else None):
        if annotation in _KINDS:
            return _KINDS[annotation]
    return "of another type"


def _branches(annotation: Any) -> list[Any]:
    """The plain types of an annotation, with unions and ``Annotated`` opened."""
    origin = get_origin(annotation)
    if origin in {Union, types.UnionType}:
        return [branch for part in get_args(annotation) for branch in _branches(part)]
    if hasattr(annotation, "__metadata__"):
        return _branches(get_args(annotation)[0])
    return [annotation]


def _metadata(field: FieldInfo) -> list[Any]:
    """Constraints of a field, also those inside an optional ``Annotated``."""
    found = list(field.metadata)
    for part in get_args(field.annotation):
        for extra in getattr(part, "__metadata__", ()):
            found.extend(extra.metadata if isinstance(extra, FieldInfo) else [extra])
    return found


def _choices(field: FieldInfo | None) -> tuple[Any, ...]:
    if field is None:
        return ()
    return tuple(
        choice for branch in _branches(field.annotation) if get_origin(branch) is Literal for choice in get_args(branch)
    )


def _allowed(field: FieldInfo | None) -> str | None:
    """The allowed range or choices of a field, in words."""
    if field is None:
        return None
    choices = _choices(field)
    if choices:
        return ", ".join(str(choice) for choice in choices)
    low = high = None
    above = False
    for constraint in _metadata(field):
        above = above or hasattr(constraint, "gt")
        low = getattr(constraint, "ge", getattr(constraint, "gt", low))
        high = getattr(constraint, "le", high)
    if low is None or high is None:
        return None
    shown = f"{high:g}" if isinstance(high, float) else str(high)
    return f"{'more than ' if above else ''}{low:g} {'and at most' if above else 'to'} {shown}"


def _limit(context: dict[str, Any]) -> str | None:
    """The one limit that a number broke, in words."""
    words = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}
    return next((f"{word} {context[key]:g}" for key, word in words.items() if key in context), None)


def _model(model: type[BaseModel] | None, location: tuple[str | int, ...]) -> type[BaseModel] | None:
    """The table a location leads to."""
    for part in location:
        if isinstance(part, int) or model is None:
            continue
        field = model.model_fields.get(part)
        model = _table_in(field.annotation) if field else None
    return model


def _table_in(annotation: Any) -> type[BaseModel] | None:
    return next(iter(_tables_in(annotation)), None)


def _field(model: type[BaseModel], location: tuple[str | int, ...]) -> FieldInfo | None:
    """The field a location names; for an entry of a list, the list."""
    names = [part for part in location if isinstance(part, str)]
    if not names or isinstance(location[-1], int):
        return None
    table = _model(model, tuple(names[:-1]))
    return table.model_fields.get(names[-1]) if table else None
