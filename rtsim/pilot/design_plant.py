"""The plant a pilot is designed for at one grid point: rigid body, actuators, gusts and integrators.

From the database's full linear model the rotor's flapping and inflow states are residualized (they settle within a
tenth of a second), the actuators of one hand become one lag in units of that hand, so that a change of gearing with the
nacelle angle does not change the meaning of a state, and gusts get first-order Dryden filters. Displays are horizontal
airspeed, altitude, climb rate, pitch, pitch rate and, where asked for, the integrals of airspeed and altitude error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rtsim.aircraft.variables import NACELLE_INPUTS, RIGID_BODY_STATES, of_role, position, required_position
from rtsim.arrays import FloatArray
from rtsim.errors import InputError
from rtsim.lpv.database import Database
from rtsim.lpv.reduction import refuse_unknown_motion, settled
from rtsim.pilot.layout_kernels import DISPLAYS
from rtsim.pilot.weights import PilotSettings

CONTROLS = ("stick", "lever")
"""The pilot's hands, as inputs of the database."""
GUSTS = ("gust_u", "gust_w")
"""Gusts the pilot reckons with, as inputs of the database."""
INTEGRALS = ("airspeed_integral", "altitude_integral")
"""Integrals of the first two displays' errors."""
_LUMPED_TOLERANCE = 1e-2


@dataclass(frozen=True, slots=True)
class PlantLayout:
    """Which of the database's states become which states of the design plant."""

    rigid: tuple[int, ...]
    """Positions of u, w, q, pitch, altitude."""
    actuators: tuple[tuple[int, ...], ...]
    """Positions of the actuator states of each hand."""
    controls: tuple[int, ...]
    """Positions of the hands among the inputs."""
    gusts: tuple[int, ...]
    """Positions of the gusts among the inputs."""
    nacelle: tuple[int, ...]
    """Positions of nacelle rate and acceleration among the inputs; -1 where there is none."""
    integrators: bool
    """Whether the integrals of airspeed and altitude error are states."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the design plant's states."""
        lags = tuple(f"{name}_lag" for name, rows in zip(CONTROLS, self.actuators, strict=True) if rows)
        return RIGID_BODY_STATES + lags + GUSTS + (INTEGRALS if self.integrators else ())

    @property
    def displays(self) -> tuple[str, ...]:
        """Names of the displays."""
        return DISPLAYS + (INTEGRALS if self.integrators else ())


@dataclass(frozen=True, slots=True)
class DesignPlant:
    """Linear plant of one grid point, deviations from trim, controls stick (-1..1) and lever (0..1). SI and radians."""

    A: FloatArray
    """Dynamics (n, n)."""
    B: FloatArray
    """Controls (n, 2)."""
    C: FloatArray
    """Displays (ny, n)."""
    E: FloatArray
    """White noises of the gust filters (n, 2)."""
    nacelle: FloatArray
    """Nacelle rate and acceleration (n, 2)."""


def plant_layout(database: Database, *, integrators: bool) -> PlantLayout:
    """Find the rigid body and the actuators of each hand among the database's states.

    Args:
        integrators: Append the integrals of airspeed and altitude error.

    Returns:
        The layout, the same for all grid points.

    Raises:
        InputError: A state or input that the pilot needs is missing.
    """
    rigid = tuple(required_position(database.states, name, "the pilot") for name in RIGID_BODY_STATES)
    controls = tuple(required_position(database.inputs, name, "the pilot") for name in CONTROLS)
    gusts = tuple(required_position(database.inputs, name, "the pilot") for name in GUSTS)
    driven = np.any(np.abs(database.B[..., controls]) > 0.0, axis=(0, 1, 2))
    refuse_unknown_motion(database, "the pilot")
    lags = of_role(database.states, "actuator")
    actuators = tuple(tuple(state for state in lags if driven[state, hand]) for hand in range(len(controls)))
    shared = [state for state in actuators[0] if state in actuators[1]]
    if shared:
        raise InputError(
            "stick and lever drive the same state directly", key=f"B[{database.states[shared[0]].name}]",
            mend="give each hand its own actuator states",
        )  # fmt: skip
    return PlantLayout(
        rigid=rigid,
        actuators=actuators,
        controls=controls,
        gusts=gusts,
        nacelle=tuple(position(database.inputs, name) for name in NACELLE_INPUTS),
        integrators=integrators,
    )


def _lumped(
    a: FloatArray, b: FloatArray, layout: PlantLayout, kept: list[int]
) -> tuple[FloatArray, FloatArray, FloatArray, list[float]]:
    """Merge each hand's actuators into one lag: dynamics, inputs, direct effect of the hands, and the lags' rates."""
    rigid = len(layout.rigid)
    columns, rates = [], []
    direct = b[:rigid, : len(CONTROLS)].copy()
    for hand, rows in enumerate(layout.actuators):
        if not rows:
            continue
        places = [kept.index(row) for row in rows]
        speeds = -np.array([a[place, place] for place in places])
        # one lag stands for all actuators of the hand; were their rates to differ, the slowest would lead
        gains = np.array([b[place, hand] for place in places]) / speeds
        if np.ptp(speeds) > _LUMPED_TOLERANCE * np.max(speeds):
            speeds = np.full_like(speeds, np.min(speeds))
        columns.append(a[:rigid, places] @ gains)
        rates.append(float(speeds[0]))
    lags = np.array(columns).T if columns else np.zeros((rigid, 0))
    return a[:rigid, :rigid], lags, direct, rates


def design_plant(
    database: Database, layout: PlantLayout, *, where: tuple[int, int, int], settings: PilotSettings
) -> DesignPlant:
    """Build the design plant of one grid point.

    Args:
        layout: Its layout.
        where: Numbers of layer, airspeed and nacelle angle.
        settings: Gusts to reckon with.

    Returns:
        The plant.
    """
    kept = [*layout.rigid, *(row for rows in layout.actuators for row in rows)]
    inputs = [*layout.controls, *layout.gusts, *(column for column in layout.nacelle if column >= 0)]
    model = settled(
        database,
        keep=[database.states[place].name for place in kept],
        inputs=[database.inputs[place].name for place in inputs],
        purpose="the pilot",
        where=where,
    )
    a, b = model.a, model.b
    body, lags, direct, rates = _lumped(a, b, layout, kept)
    names = layout.states
    n, rigid, hands = len(names), len(layout.rigid), len(CONTROLS)
    first_lag, first_gust = rigid, rigid + len(rates)
    gust = slice(first_gust, first_gust + len(GUSTS))

    plant_a, plant_b, plant_e = np.zeros((n, n)), np.zeros((n, hands)), np.zeros((n, len(GUSTS)))
    plant_a[:rigid, :rigid], plant_a[:rigid, first_lag:first_gust] = body, lags
    plant_a[:rigid, gust] = b[:rigid, hands : hands + len(GUSTS)]
    plant_b[:rigid] = direct
    driven = [hand for hand, rows in enumerate(layout.actuators) if rows]
    for lag, (hand, rate) in enumerate(zip(driven, rates, strict=True)):
        plant_a[first_lag + lag, first_lag + lag], plant_b[first_lag + lag, hand] = -rate, rate
        plant_b[:rigid, hand] = 0.0
    airspeed = abs(float(database.airspeed[where[1]]))
    pole = max(airspeed, settings.gust_least_airspeed) / settings.gust_length
    for k in range(len(GUSTS)):
        plant_a[first_gust + k, first_gust + k] = -pole
        plant_e[first_gust + k, k] = settings.gust_intensity * np.sqrt(2.0 * pole)

    nacelle = np.zeros((n, len(NACELLE_INPUTS)))
    column = hands + len(GUSTS)
    for k, place in enumerate(layout.nacelle):
        if place >= 0:
            nacelle[:rigid, k] = b[:rigid, column]
            column += 1
    displays = _displays(database.x_ref[where], layout, first_gust)
    if layout.integrators:
        plant_a[n - 2 :] = displays[:2]
        # A lasting speed error is the aircraft's own, not a gust's: without this the filter, which sees airspeed only
        # as the sum of both, explains it as a gust for minutes (slowest pole -0.005 instead of -0.08 rad/s).
        plant_a[n - 2, gust] = 0.0
    return DesignPlant(A=plant_a, B=plant_b, C=displays, E=plant_e, nacelle=nacelle)


def _displays(x_ref: FloatArray, layout: PlantLayout, first_gust: int) -> FloatArray:
    """Displays as linear functions of the design plant's states, exact at the trim."""
    u, w, _, pitch, _ = (float(x_ref[place]) for place in layout.rigid)
    sine, cosine = np.sin(pitch), np.cos(pitch)
    n = len(layout.states)
    c = np.zeros((len(layout.displays), n))
    # airspeed = (u + gust_u) cos + (w + gust_w) sin: what an airspeed indicator senses
    c[0, [0, 1, 3]] = cosine, sine, w * cosine - u * sine
    c[0, [first_gust, first_gust + 1]] = cosine, sine
    c[1, 4] = 1.0
    c[2, [0, 1, 3]] = sine, -cosine, u * cosine + w * sine
    c[3, 3] = 1.0
    c[4, 2] = 1.0
    if layout.integrators:
        c[5, n - 2], c[6, n - 1] = 1.0, 1.0
    return c
