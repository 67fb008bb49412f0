"""The pilot's instruments in one flat view: attitude, airspeed and altitude tapes, conversion angle, numerals.

Units are those of the drawing: x right, y down, (0, 0) in the middle of the attitude ball.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view.colours import (
    ACTING,
    AMBER,
    BACKGROUND,
    CYAN,
    DIM,
    FRAME,
    GREEN,
    GROUND,
    HIGH_SIDE,
    LEVELS,
    LOW_SIDE,
    PANEL,
    RED,
    SKY,
    TEXT,
    WHITE,
)  # fmt: skip
from telemetry.view.corridor import level_of
from telemetry.view.strokes import LineArt

BOUNDS = ((-160.0, 160.0), (-101.0, 224.0))
"""What the view shows: x range, y range."""
LEVEL_WORDS = ("CORRIDOR CLEAR", "CORRIDOR CAUTION", "CORRIDOR WARNING", "OUTSIDE CORRIDOR")
"""What the band under the ball says at each level."""

PICTURES_PER_TEXT = 3
"""Numerals change only in every third picture: faster could not be read, and they are most of the data."""

_PITCH_SCALE = 3.2  # units per degree
_SPEED_SCALE = 1.6  # units per knot
_ALTITUDE_SCALE = 3.0  # units per metre
_BALL_EDGE, _TAPE_EDGE = 78.0, 156.0
_TOP, _BOTTOM = -96.0, 84.0
_FAR = 3000.0
_DIAL = (-136.0, 206.0)
_DIAL_RADIUS = 76.0


class Instruments:
    """Logs the instruments to one recording."""

    def __init__(self, recording: Any) -> None:
        """Log everything that does not move by itself.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording = recording
        self._updates = 0
        self._static("instruments/ball", _ball(), 0.0)
        self._static("instruments/columns", _columns(), 1.0)
        self._static("instruments/speed_tape", _tape(-40, 320, scale=_SPEED_SCALE, side=-1.0, step=10, labels=20), 2.0)
        self._static(
            "instruments/altitude_tape", _tape(-50, 1000, scale=_ALTITUDE_SCALE, side=1.0, step=5, labels=10), 2.0
        )
        self._static("instruments/masks", _masks(), 4.0)
        self._static("instruments/faces", _faces(), 5.0)

    def update(self, row: FloatArray) -> None:
        """Show one row."""
        shift = {
            "ball": _PITCH_SCALE * float(row[COLUMN.pitch_deg]),
            "speed_tape": _SPEED_SCALE * float(row[COLUMN.airspeed_kt]),
            "altitude_tape": _ALTITUDE_SCALE * float(row[COLUMN.altitude_m]),
        }
        for name, down in shift.items():
            self._recording.log(f"instruments/{name}", rr.Transform3D(translation=[0.0, down, 0.0]))
        bugs = LineArt()
        _draw_speed_limits(bugs, row)
        self._recording.log("instruments/bugs", bugs.archetype(3.0))
        moving = LineArt()
        _draw_needle(moving, row)
        _draw_controls(moving, row)
        self._recording.log("instruments/moving", moving.archetype(6.0))
        if self._updates % PICTURES_PER_TEXT == 0:
            text = LineArt()
            _draw_windows(text, row)
            _draw_annunciator(text, row)
            _draw_numerals(text, row)
            self._recording.log("instruments/text", text.archetype(7.0))
        self._updates += 1

    def _static(self, path: str, art: LineArt, order: float) -> None:
        self._recording.log(path, art.archetype(order), static=True)


def _ball() -> LineArt:
    """Sky, earth and pitch ladder around the horizon at y = 0."""
    art = LineArt()
    art.line([[-_FAR, -1500.0], [_FAR, -1500.0]], SKY, radius=1500.0)
    art.line([[-_FAR, 1500.0], [_FAR, 1500.0]], GROUND, radius=1500.0)
    art.line([[-_FAR, 0.0], [_FAR, 0.0]], WHITE, radius=-1.2)
    for degrees in range(-60, 61, 5):
        y = -_PITCH_SCALE * degrees
        if degrees % 10 == 0 and degrees:
            art.line([[-26.0, y], [26.0, y]], WHITE, radius=-0.9)
            for x in (-36.0, 36.0):
                art.text(str(abs(degrees)), x, y, height=7.0, colour=WHITE, align="centre")
        elif degrees:
            art.line([[-12.0, y], [12.0, y]], WHITE, radius=-0.7)
    return art


def _columns() -> LineArt:
    """The ground of the tapes, which also ends the ball left and right."""
    art = LineArt()
    for side in (-1.0, 1.0):
        art.line([[side * (_BALL_EDGE + 200.0), -_FAR], [side * (_BALL_EDGE + 200.0), _FAR]], PANEL, radius=200.0)
    return art


def _tape(first: int, last: int, *, scale: float, side: float, step: int, labels: int) -> LineArt:
    """A scale of numbers, moved as a whole; value 0 is at y = 0 and values grow upwards."""
    art = LineArt()
    inner = side * (_BALL_EDGE + 2.0)
    for value in range(first, last + 1, step):
        y = -scale * value
        long = value % labels == 0
        art.line([[inner, y], [inner + side * (9.0 if long else 5.0), y]], DIM, radius=-0.7)
        if long:
            align: Any = "right" if side < 0.0 else "left"
            art.text(str(value), inner + side * 14.0, y, height=8.5, colour=TEXT, align=align)
    return art


def _masks() -> LineArt:
    """Cover what the moving parts show outside their windows."""
    art = LineArt()
    art.line([[-_FAR, _TOP - 500.0], [_FAR, _TOP - 500.0]], BACKGROUND, radius=500.0)
    art.line([[-_FAR, _BOTTOM + 500.0], [_FAR, _BOTTOM + 500.0]], BACKGROUND, radius=500.0)
    for side in (-1.0, 1.0):
        x = side * (_TAPE_EDGE + 1000.0)
        art.line([[x, -_FAR], [x, _FAR]], BACKGROUND, radius=1000.0)
    return art


def _faces() -> LineArt:
    """Frames, the aircraft symbol and the faces of the lower instruments."""
    art = LineArt()
    art.box(-_BALL_EDGE, _TOP, _BALL_EDGE, _BOTTOM, colour=FRAME)
    for side in (-1.0, 1.0):
        art.box(side * _BALL_EDGE, _TOP, side * _TAPE_EDGE, _BOTTOM, colour=FRAME)
    for wing in ([[-58.0, 0.0], [-22.0, 0.0], [-22.0, 8.0]], [[58.0, 0.0], [22.0, 0.0], [22.0, 8.0]]):
        art.line(wing, BACKGROUND, radius=3.0)
        art.line(wing, AMBER, radius=1.8)
    art.line([[-1.0, 0.0], [1.0, 0.0]], BACKGROUND, radius=3.6)
    art.line([[-0.5, 0.0], [0.5, 0.0]], AMBER, radius=2.4)
    for side in (-1.0, 1.0):
        near, far = side * (_BALL_EDGE + 6.0), side * (_TAPE_EDGE - 6.0)
        art.bar(min(near, far), _TOP + 2.0, max(near, far), _TOP + 15.0, colour=PANEL)
    art.text("kn", -_TAPE_EDGE + 5.0, _TOP + 9.0, height=6.0, colour=DIM)
    art.text("alt m", _TAPE_EDGE - 5.0, _TOP + 9.0, height=6.0, colour=DIM, align="right")
    _draw_dial_face(art)
    return art


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
    art.text("nacelle", 6.0, 118.0, height=6.5, colour=DIM, align="right")


def _draw_speed_limits(art: LineArt, row: FloatArray) -> None:
    """Corridor boundaries and references beside the tapes: what is barred, what is asked for."""
    speed = float(row[COLUMN.airspeed_kt])
    inner = -_BALL_EDGE - 3.0
    low_y = _SPEED_SCALE * float(row[COLUMN.margin_low_kt])
    high_y = -_SPEED_SCALE * float(row[COLUMN.margin_high_kt])
    art.line([[inner, low_y], [inner, low_y + _FAR]], LOW_SIDE, radius=2.2)
    art.line([[inner, high_y], [inner, high_y - _FAR]], HIGH_SIDE, radius=2.2)
    for reference, value, scale, side in (
        (float(row[COLUMN.airspeed_reference_kt]), speed, _SPEED_SCALE, -1.0),
        (float(row[COLUMN.altitude_reference_m]), float(row[COLUMN.altitude_m]), _ALTITUDE_SCALE, 1.0),
    ):
        y = min(max(-scale * (reference - value), _TOP + 4.0), _BOTTOM - 4.0)
        x = side * (_BALL_EDGE + 1.0)
        art.line([[x, y], [x + side * 7.0, y - 5.0], [x + side * 7.0, y + 5.0], [x, y]], CYAN, radius=-1.3)


def _draw_windows(art: LineArt, row: FloatArray) -> None:
    """Large airspeed and altitude in the middle of their tapes, rates below."""
    for side, text, rate in (
        (-1.0, f"{row[COLUMN.airspeed_kt]:.0f}", f"{row[COLUMN.airspeed_rate_kt_s]:+.1f} kn/s"),
        (1.0, f"{row[COLUMN.altitude_m]:.1f}", f"{row[COLUMN.climb_rate_m_s]:+.1f} m/s"),
    ):
        near, far = side * (_BALL_EDGE + 10.0), side * _TAPE_EDGE
        left, right = min(near, far), max(near, far)
        art.line([[left + 9.0, 0.0], [right - 9.0, 0.0]], BACKGROUND, radius=12.5)
        art.box(left, -13.0, right, 13.0, colour=WHITE)
        art.text(
            text, right - 4.0, 0.0, height=14.0 if len(text) < 5 else 12.0, colour=WHITE, align="right", weight=1.25
        )
        art.bar(left + 5.0, 68.0, right - 5.0, 82.0, colour=BACKGROUND)
        art.text(rate, 0.5 * (left + right), 75.0, height=6.5, colour=TEXT, align="centre")
    art.bar(-40.0, _TOP + 3.0, 40.0, _TOP + 15.0, colour=BACKGROUND)  # as wide as the ladder, whose numbers it hides
    art.text(f"pitch {row[COLUMN.pitch_deg]:+.1f}", 0.0, _TOP + 9.0, height=6.0, colour=WHITE, align="centre")


def _draw_annunciator(art: LineArt, row: FloatArray) -> None:
    level = level_of(row)
    colour = LEVELS[level]
    art.box(-_TAPE_EDGE, _BOTTOM + 4.0, _TAPE_EDGE, _BOTTOM + 22.0, colour=colour, radius=-1.6)
    words = f"{LEVEL_WORDS[level]}  margin {row[COLUMN.margin_kt]:+.0f} kn"
    art.text(words, 0.0, _BOTTOM + 13.0, height=9.5, colour=colour, align="centre", weight=1.2)


def _draw_needle(art: LineArt, row: FloatArray) -> None:
    nacelle, reference = float(row[COLUMN.nacelle_deg]), float(row[COLUMN.nacelle_reference_deg])
    tip = _on_dial(nacelle, _DIAL_RADIUS - 12.0)
    art.line([_DIAL, tip], WHITE, radius=2.2)
    art.line([_on_dial(nacelle + 90.0, 16.0), _DIAL], WHITE, radius=1.2)
    across = [_on_dial(nacelle, _DIAL_RADIUS - 16.0) + offset * _direction(nacelle + 90.0) for offset in (-20.0, 20.0)]
    art.line(np.array(across), (*TEXT, 190), radius=1.3)
    art.line([_on_dial(reference, _DIAL_RADIUS + 1.0), _on_dial(reference, _DIAL_RADIUS - 9.0)], CYAN, radius=1.4)


def _draw_numerals(art: LineArt, row: FloatArray) -> None:
    nacelle, reference = float(row[COLUMN.nacelle_deg]), float(row[COLUMN.nacelle_reference_deg])
    art.text(f"{nacelle:.1f}\N{DEGREE SIGN}", 8.0, 133.0, height=13.0, colour=WHITE, align="right", weight=1.25)
    art.text(f"ref {reference:.1f}\N{DEGREE SIGN}", 7.0, 149.0, height=6.5, colour=CYAN, align="right")
    flapping = float(row[COLUMN.flapping_deg])
    short = row[COLUMN.engine_power_shp] > row[COLUMN.engine_power_available_shp]
    entries = (
        ("flapping", f"{flapping:.1f}\N{DEGREE SIGN}", AMBER if flapping > 6.0 else WHITE),
        ("power shp", f"{row[COLUMN.power_shp]:.0f}", AMBER if short else WHITE),
        ("torque in lb", f"{row[COLUMN.mast_torque_inlb] / 1000.0:.0f} k", WHITE),
        ("load factor", f"{row[COLUMN.load_factor]:.2f}", WHITE),
    )
    for index, (name, value, colour) in enumerate(entries):
        y = 118.0 + 18.0 * index
        art.text(name, 20.0, y, height=6.5, colour=DIM)
        art.text(value, _TAPE_EDGE, y, height=11.0, colour=colour, align="right", weight=1.15)


def _draw_controls(art: LineArt, row: FloatArray) -> None:
    """Stick and lever as bars between their stops; what the hands ask for where protection gives something else."""
    for y, name, value, asked, reason, low, high in (
        (194.0, "stick", row[COLUMN.stick], row[COLUMN.pilot_stick], row[COLUMN.protection_stick_reason], -1.0, 1.0),
        (212.0, "lever", row[COLUMN.lever], row[COLUMN.pilot_lever], row[COLUMN.protection_lever_reason], 0.0, 1.0),
    ):
        left, right = 78.0, _TAPE_EDGE
        art.text(f"{name} prot" if reason else name, 10.0, y, height=6.5, colour=ACTING if reason else DIM)
        art.box(left, y - 5.0, right, y + 5.0, colour=FRAME)
        zero = left + (right - left) * (0.0 - low) / (high - low)
        place = left + (right - left) * (min(max(value, low), high) - low) / (high - low)
        stopped = value <= low or value >= high
        if abs(place - zero) > 0.1:
            art.line([[zero, y], [place, y]], RED if stopped else GREEN, radius=2.2)
        art.line([[place, y - 5.0], [place, y + 5.0]], WHITE, radius=-1.5)
        if reason:
            hands = left + (right - left) * (min(max(asked, low), high) - low) / (high - low)
            art.line([[place, y], [hands, y]], ACTING, radius=1.0)
            art.line([[hands, y - 7.0], [hands, y + 7.0]], ACTING, radius=-1.5)


def _direction(angle_deg: float) -> FloatArray:
    """Where a nacelle angle points on the dial: 0 to the right, 90 up."""
    angle = math.radians(angle_deg)
    return np.array([math.cos(angle), -math.sin(angle)])


def _on_dial(angle_deg: float, radius: float) -> FloatArray:
    return np.array(_DIAL) + radius * _direction(angle_deg)
