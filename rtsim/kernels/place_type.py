"""Teaches the compiler that ``Places`` are constants: an aggregate of eighty numbers would be built at each use."""

from __future__ import annotations

import hashlib
from typing import Any

from numba import types
from numba.core.imputils import lower_constant
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model, typeof_impl

from rtsim.places import Places


class PlacesType(types.Type):
    """Type of ``Places``: its names and numbers."""

    def __init__(self, places: Places) -> None:
        """Name the type by its contents.

        Args:
            places: The places.
        """
        self.values = {**places.asdict(), "size": places.size}
        super().__init__(name=f"Places_{hashlib.sha256(repr(self.values).encode()).hexdigest()[:12]}")


@typeof_impl.register(Places)
def _typeof_places(value: Places, _context: Any) -> Any:
    return PlacesType(value)


@register_model(PlacesType)
class _PlacesModel(models.OpaqueModel):
    """Nothing: all is known when compiled."""


@infer_getattr
class _PlacesAttributes(AttributeTemplate):
    key = PlacesType

    def generic_resolve(self, kind: Any, name: str) -> Any:
        return types.int64 if name in kind.values else None


@lower_getattr_generic(PlacesType)
def _place(context: Any, _builder: Any, kind: Any, _value: Any, name: str) -> Any:
    return context.get_constant(types.int64, kind.values[name])


@lower_constant(PlacesType)
def _constant(context: Any, _builder: Any, _kind: Any, _value: Any) -> Any:
    return context.get_dummy_value()
