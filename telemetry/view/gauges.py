"""The lower instruments: conversion-angle dial, flapping and torque of both rotors, power, positions of the controls.

Units are those of the drawing of ``telemetry.view.instruments``.

Legend:
    art: What is drawn on.
"""

from __future__ import annotations

import math

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view.colours import ACTING, AMBER, CYAN, DIM, FRAME, GREEN, LEFT_ROTOR, RED, RIGHT_ROTOR, TEXT, WHITE
from telemetry.view.lamps import FLAPPING_HIGH, TORQUE_HIGH
from telemetry.view.strokes import LineArt

_RIGHT = 156.0
_TOP, _LAST = 179.0, 266.0
_DIAL = (-136.0, 267.0)
_DIAL_RADIUS = 76.0
_SIDES_SHOWN = (("flapping", FLAPPING_HIGH, 12.0), ("torque in lb", TORQUE_HIGH, 180_000.0))
"""What is shown of both rotors: name, where its amber mark is, full scale."""
_SIDES_LEFT, _SIDES_STEP, _SIDES_BELOW = 28.0, 44.0, (12.5, 19.5)
_CONTROLS = (
    (
        "lateral",
        -1.0,
        (COLUMN.lateral_stick, COLUMN.pilot_lateral_stick, COLUMN.protection_lateral_stick_reason),
    ),
    ("pedals", -1.0, (COLUMN.pedal, COLUMN.pilot_pedal, COLUMN.protection_pedal_reason)),
    ("stick", -1.0, (COLUMN.stick, COLUMN.pilot_stick, COLUMN.protection_stick_reason)),
    ("lever", 0.0, (COLUMN.lever, COLUMN.pilot_lever, COLUMN.protection_lever_reason)),
)
"""Name, lower stop, and columns of what acts, what is asked for, and why they differ."""


def draw_faces(art: LineArt) -> None:
    """What does not move."""
    _draw_dial_face(art)
    for index, (name, limit, full) in enumerate(_SIDES_SHOWN):
        y = _TOP + _SIDES_STEP * index
        art.text(name, 20.0, y, height=6.5, colour=DIM)
        for letter, below in zip("LR", _SIDES_BELOW, strict=True):
            art.text(letter, 20.0, y + below, height=5.0, colour=DIM)
        x = _SIDES_LEFT + (_RIGHT - _SIDES_LEFT) * limit / full
        art.line([[x, y + 9.5], [x, y + 22.5]], AMBER, radius=-1.0)
    art.text("shp", 20.0, _LAST, height=6.5, colour=DIM)
    art.text("load", 84.0, _LAST, height=6.5, colour=DIM)


def draw_moving(art: LineArt, row: FloatArray) -> None:
    """What moves in every picture: needle, bars, controls."""
    _draw_needle(art, row)
    _draw_sides(art, row)
    _draw_controls(art, row)


def _draw_dial_face(art: LineArt) -> None:
    """Quarter circle of the conversion angle: ahead is airplane mode, up is helicopter mode."""
    art.line([_on_dial(angle, _DIAL_RADIUS) for angle in np.linspace(0.0, 95.0, 40)], FRAME, radius=-1.4)
    for angle in range(0, 91, 5):
        long = angle % 15 == 0
        art.line(
            [_on_dial(angle, _DIAL_RADIUS), _on_dial(angle, _DIAL_RADIUS - (8.0 if long else 4.0))], DIM, radius=-0.8
        )
        if angle % 30 == 0:
            x, y = _on_dial(angle, _DIAL_RADIUS + 9.0)
            art.text(str(angle), x, y, height=6.5, colour=DIM, align="centre")
    for detent in (75.0, 50.0):
        art.line([_on_dial(detent, _DIAL_RADIUS + 1.0), _on_dial(detent, _DIAL_RADIUS + 6.0)], AMBER, radius=-1.6)
    art.text("nacelle", 6.0, _TOP, height=6.5, colour=DIM, align="right")


def _draw_needle(art: LineArt, row: FloatArray) -> None:
    nacelle, reference = float(row[COLUMN.nacelle_deg]), float(row[COLUMN.nacelle_reference_deg])
    tip = _on_dial(nacelle, _DIAL_RADIUS - 12.0)
    art.line([_DIAL, tip], WHITE, radius=2.2)
    art.line([_on_dial(nacelle + 90.0, 16.0), _DIAL], WHITE, radius=1.2)
    across = [_on_dial(nacelle, _DIAL_RADIUS - 16.0) + offset * _direction(nacelle + 90.0) for offset in (-15.0, 15.0)]
    art.line(np.array(across), (*TEXT, 190), radius=1.3)
    art.line([_on_dial(reference, _DIAL_RADIUS + 1.0), _on_dial(reference, _DIAL_RADIUS - 9.0)], CYAN, radius=1.4)


def draw_numerals(art: LineArt, row: FloatArray) -> None:
    """Nacelle angle and reference, the larger of both rotors' flapping and torque, power, load factor."""
    nacelle, reference = float(row[COLUMN.nacelle_deg]), float(row[COLUMN.nacelle_reference_deg])
    art.text(f"{nacelle:.1f}\N{DEGREE SIGN}", 8.0, _TOP + 15.0, height=13.0, colour=WHITE, align="right", weight=1.25)
    art.text(f"ref {reference:.1f}\N{DEGREE SIGN}", 7.0, _TOP + 31.0, height=6.5, colour=CYAN, align="right")
    flapping = max(float(row[COLUMN.flapping_left_deg]), float(row[COLUMN.flapping_right_deg]))
    torque = max(float(row[COLUMN.mast_torque_left_inlb]), float(row[COLUMN.mast_torque_right_inlb]))
    short = row[COLUMN.engine_power_shp] > row[COLUMN.engine_power_available_shp]
    for y, value, colour in (
        (_TOP, f"{flapping:.1f}\N{DEGREE SIGN}", AMBER if flapping > FLAPPING_HIGH else WHITE),
        (_TOP + _SIDES_STEP, f"{torque / 1000.0:.0f} k", AMBER if torque > TORQUE_HIGH else WHITE),
    ):
        art.text(value, _RIGHT, y, height=11.0, colour=colour, align="right", weight=1.15)
    power, load = f"{row[COLUMN.power_shp]:.0f}", f"{row[COLUMN.load_factor]:.2f}"
    for right, value, colour in ((75.0, power, AMBER if short else WHITE), (_RIGHT, load, WHITE)):
        art.text(value, right, _LAST, height=9.0, colour=colour, align="right", weight=1.15)


def _draw_sides(art: LineArt, row: FloatArray) -> None:
    """Flapping and torque of the left and right rotor as bars, one above the other, in the rotors' colours."""
    for index, (left, right) in enumerate(
        (
            (row[COLUMN.flapping_left_deg], row[COLUMN.flapping_right_deg]),
            (row[COLUMN.mast_torque_left_inlb], row[COLUMN.mast_torque_right_inlb]),
        )
    ):
        full, top = _SIDES_SHOWN[index][2], _TOP + _SIDES_STEP * index
        for value, below, colour in zip((left, right), _SIDES_BELOW, (LEFT_ROTOR, RIGHT_ROTOR), strict=True):
            end = _SIDES_LEFT + (_RIGHT - _SIDES_LEFT) * min(max(float(value) / full, 0.0), 1.0)
            art.line([[_SIDES_LEFT, top + below], [end, top + below]], colour, radius=1.6)


def _draw_controls(art: LineArt, row: FloatArray) -> None:
    """Every control between its stops; what the hands ask for where protection gives something else."""
    for left, y, (name, low, places) in zip((-80.0, -80.0, 86.0, 86.0), (288.0, 305.0) * 2, _CONTROLS, strict=True):
        value, asked, reason = (float(row[place]) for place in places)
        right = left + 70.0
        words = f"{name} prot" if reason else name
        art.text(words, left - 76.0, y, height=6.5, colour=ACTING if reason else DIM)
        art.box(left, y - 5.0, right, y + 5.0, colour=FRAME)
        zero = left + (right - left) * (0.0 - low) / (1.0 - low)
        place = left + (right - left) * (min(max(value, low), 1.0) - low) / (1.0 - low)
        stopped = value <= low or value >= 1.0
        if abs(place - zero) > 0.1:
            art.line([[zero, y], [place, y]], RED if stopped else GREEN, radius=2.2)
        art.line([[place, y - 5.0], [place, y + 5.0]], WHITE, radius=-1.5)
        if reason:
            hands = left + (right - left) * (min(max(asked, low), 1.0) - low) / (1.0 - low)
            art.line([[place, y], [hands, y]], ACTING, radius=1.0)
            art.line([[hands, y - 7.0], [hands, y + 7.0]], ACTING, radius=-1.5)


def _direction(angle_deg: float) -> FloatArray:
    """Where a nacelle angle points on the dial: 0 to the right, 90 up."""
    angle = math.radians(angle_deg)
    return np.array([math.cos(angle), -math.sin(angle)])


def _on_dial(angle_deg: float, radius: float) -> FloatArray:
    return np.array(_DIAL) + radius * _direction(angle_deg)
