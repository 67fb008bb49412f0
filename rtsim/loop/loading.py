"""Compiles the parts of a frame, or loads them from the kernel cache, and notes their addresses in the flight."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtsim.kernels.packed import Packed
from rtsim.kernels.parts import address_of, entry_point
from rtsim.loop import part_kernels as parts
from rtsim.loop.data import PART, Flight
from rtsim.loop.plant_kernels import PLANT_PARTS
from rtsim.protection.law_data import LAW_MONITOR

_Key = tuple[str, tuple[Any, ...]]
_ADDRESSES: dict[_Key, int] = {}
_ENTRIES: dict[_Key, Any] = {}
"""What this process has compiled or loaded, by kernel and types of its arguments."""
_PARTS: dict[str, Any] = {
    "ask": parts.ask_mocm,
    "advance": parts.advance_mocm,
    "aids": parts.act_aids,
    "air": parts.move_air,
    "faults": parts.schedule_faults,
    "fail": parts.fail_actuators,
    "failed": parts.put_failed_actuators,
    "automatic_rate": parts.rate_of_automatic_nacelle,
    "automatic_advance": parts.advance_automatic_nacelle,
    "script": parts.act_script,
    "notice": parts.notice_warning,
}
_LATERAL: dict[str, Any] = {"ask_lateral": parts.ask_lateral, "advance_lateral": parts.advance_lateral}
"""Those of the pilot's lateral half, which also take its tables."""
_MORE: dict[str, tuple[Any, ...]] = {
    "advance": (np.zeros(0),), "advance_lateral": (np.zeros(0),), "air": (0.0, np.zeros(0)),
}  # fmt: skip
"""Arguments that a part takes besides the flight."""


def load_part(flight: Flight, name: str, *, nonlinear: bool) -> None:
    """Compile a part or load it, and note its address; where failures are scheduled, they also act.

    Args:
        flight: The flight, packed.
        name: One of ``PART``.
        nonlinear: The nonlinear aircraft flies.
    """
    scratch, state, aircraft = flight.scratch, flight.state, flight.tables.plant.aircraft.target
    kernel: Any
    if name == "outputs":
        kernel = PLANT_PARTS[type(aircraft._tuple)][0]
        arguments: tuple[Any, ...] = (aircraft, state.x, state.u, 0.0, scratch.y, scratch.xdot, scratch.work)
    elif name == "step":
        kernel = PLANT_PARTS[type(aircraft._tuple)][1]
        arguments = (aircraft, state.x, state.u, scratch.path, 0.0, scratch.work)
    elif name == "decide":
        # The monitor flies with most flights: it is compiled without what the other laws need.
        watches = flight.tables.protection.law == LAW_MONITOR
        kernel, arguments = (parts.watch_law if watches else parts.decide_law), (flight,)
    elif name in _LATERAL:
        kernel, arguments = _LATERAL[name], (flight, flight.tables.lateral_pilot.target, *_MORE.get(name, ()))
    else:
        kernel, arguments = _PARTS[name], (flight, *_MORE.get(name, ()))
    flight.parts[getattr(PART, name)] = part_address(kernel, *arguments)
    if name == "faults":
        load_part(flight, "fail", nonlinear=nonlinear)
        load_part(flight, "failed", nonlinear=nonlinear)


def part_address(kernel: Any, *arguments: Any) -> int:
    """Address of a part for arguments of these types.

    Args:
        kernel: The part.
        arguments: Arguments as it will be called with.
    """
    key = _key(kernel, arguments)
    if key not in _ADDRESSES:
        _ADDRESSES[key] = address_of(kernel, *arguments)
    return _ADDRESSES[key]


def entry_of(kernel: Any, *arguments: Any) -> Any:
    """What calls a kernel from Python without looking at the types of its arguments again.

    Args:
        kernel: The kernel.
        arguments: Arguments of the types that it will be called with.
    """
    key = _key(kernel, arguments)
    if key not in _ENTRIES:
        _ENTRIES[key] = entry_point(kernel, *arguments)
    return _ENTRIES[key]


def _key(kernel: Any, arguments: tuple[Any, ...]) -> _Key:
    return kernel.__qualname__, tuple(one._kind if isinstance(one, Packed) else type(one) for one in arguments)
