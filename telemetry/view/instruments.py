"""The pilot's instruments in one flat view: attitude, airspeed, altitude and heading tapes, conversion angle, numerals.

Units are those of the drawing: x right, y down, (0, 0) in the middle of the attitude ball.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN
from telemetry.view import gauges, lamps
from telemetry.view.colours import (
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
    SKY,
    TEXT,
    WHITE,
)  # fmt: skip
from telemetry.view.corridor import level_of
from telemetry.view.strokes import LineArt

BOUNDS = ((-160.0, 160.0), (-100.0, 316.0))
"""What the view shows: x range, y range."""
LEVEL_WORDS = ("CORRIDOR CLEAR", "CAUTION", "WARNING", "OUTSIDE")
"""What the band under the ball says at each level."""
SIDE_WORDS = ("TOO SLOW", "TOO FAST")
"""What it adds where the aircraft is near the low or the high side."""

PICTURES_PER_TEXT = 3
"""Numerals change only in every third picture: faster could not be read, and they are most of the data."""

_PITCH_SCALE = 3.2  # units per degree
_SPEED_SCALE = 1.6  # units per knot
_ALTITUDE_SCALE = 3.0  # units per metre
_HEADING_SCALE = 2.5  # units per degree
_BALL_EDGE, _TAPE_EDGE = 78.0, 156.0
_TOP, _BALL_BOTTOM, _BOTTOM = -96.0, 84.0, 105.0  # the heading tape is below the ball
_BANK_RADIUS = 71.0
_BANK_MARKS = ((0, 8.0), (10, 4.0), (20, 4.0), (30, 8.0), (45, 4.0), (60, 8.0))  # degrees, length
_SLIP_Y, _SLIP_REACH, _SLIP_SCALE = 75.0, 26.0, 200.0  # units per g
_TREND_S = 6.0  # the bar of the turn rate ends at the heading after this time
_STANDARD_RATE = 3.0  # deg/s
_DRIFT_SHOWN_KT = 5.0  # speed over the ground from which on its direction is shown
_FAR = 3000.0


class Instruments:
    """Logs the instruments to one recording."""

    def __init__(self, recording: Any) -> None:
        """Log everything that does not move by itself.

        Args:
            recording: The ``rerun.RecordingStream``.
        """
        self._recording = recording
        self._updates = 0
        self._shown: dict[str, tuple[float, ...]] = {}
        self._static("instruments/ball", _ball(), 0.0)
        ground = LineArt()
        middle = 0.5 * (_BALL_BOTTOM + _BOTTOM)
        ground.line([[-_FAR, middle], [_FAR, middle]], PANEL, radius=middle - _BALL_BOTTOM)
        self._static("instruments/heading_ground", ground, 0.4)
        self._static("instruments/heading_tape", _heading_tape(), 0.5)
        self._static("instruments/columns", _columns(), 1.0)
        self._static("instruments/speed_tape", _tape(-40, 320, scale=_SPEED_SCALE, side=-1.0, step=10, labels=20), 2.0)
        self._static(
            "instruments/altitude_tape", _tape(-50, 1000, scale=_ALTITUDE_SCALE, side=1.0, step=5, labels=10), 2.0
        )
        self._static("instruments/masks", _masks(), 4.0)
        self._static("instruments/faces", _faces(), 5.0)

    def update(self, row: FloatArray) -> None:
        """Show one row."""
        bank, pitch = math.radians(row[COLUMN.bank_deg]), _PITCH_SCALE * float(row[COLUMN.pitch_deg])
        places = {
            "ball": (pitch * math.sin(bank), pitch * math.cos(bank), -bank),
            "speed_tape": (0.0, _SPEED_SCALE * float(row[COLUMN.airspeed_kt]), 0.0),
            "altitude_tape": (0.0, _ALTITUDE_SCALE * float(row[COLUMN.altitude_m]), 0.0),
            "heading_tape": (-_HEADING_SCALE * float(row[COLUMN.heading_deg]), 0.0, 0.0),
        }
        rung = np.round(row[COLUMN.pitch_deg] / 5.0)
        if np.isfinite(rung) and self._changed("ladder", rung):
            self._recording.log("instruments/ball/ladder", _ladder(int(rung)).archetype(0.2))
        for name, place in places.items():
            if self._changed(name, *place):
                x, y, turned = place
                rotation = rr.RotationAxisAngle([0.0, 0.0, 1.0], radians=turned) if turned else None
                self._recording.log(f"instruments/{name}", rr.Transform3D(translation=[x, y, 0.0], rotation=rotation))
        bugs = LineArt()
        _draw_speed_limits(bugs, row)
        self._recording.log("instruments/bugs", bugs.archetype(3.0))
        moving = LineArt()
        _draw_bank_and_slip(moving, row)
        _draw_course(moving, row)
        gauges.draw_moving(moving, row)
        self._recording.log("instruments/moving", moving.archetype(6.0))
        if self._updates % PICTURES_PER_TEXT == 0:
            text = LineArt()
            _draw_windows(text, row)
            _draw_annunciator(text, row)
            lamps.draw(text, row)
            gauges.draw_numerals(text, row)
            self._recording.log("instruments/text", text.archetype(7.0))
        self._updates += 1

    def _changed(self, name: str, *values: float) -> bool:
        """Whether something is not as it was last shown."""
        before = self._shown.get(name)
        self._shown[name] = values
        return before != values

    def _static(self, path: str, art: LineArt, order: float) -> None:
        self._recording.log(path, art.archetype(order), static=True)


def _ball() -> LineArt:
    """Sky and earth around the horizon at y = 0."""
    art = LineArt()
    art.line([[-_FAR, -1500.0], [_FAR, -1500.0]], SKY, radius=1500.0)
    art.line([[-_FAR, 1500.0], [_FAR, 1500.0]], GROUND, radius=1500.0)
    art.line([[-_FAR, 0.0], [_FAR, 0.0]], WHITE, radius=-1.2)
    return art


def _ladder(rung: int) -> LineArt:
    """The rungs of the pitch ladder around one of them, few enough to be clear of the bank scale.

    Args:
        rung: Number of the rung nearest to the aircraft symbol, one every 5 degrees.
    """
    art = LineArt()
    for degrees in range(5 * (rung - 2), 5 * (rung + 3), 5):
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


def _heading_tape() -> LineArt:
    """The compass as a strip; heading 0 is at x = 0, and it goes on beyond 0 and 360."""
    art = LineArt()
    for degrees in range(-40, 401, 5):
        x, long = _HEADING_SCALE * degrees, degrees % 10 == 0
        art.line([[x, _BOTTOM - (6.0 if long else 3.0)], [x, _BOTTOM]], DIM, radius=-0.7)
        if degrees % 30 == 0:
            quarter = {0: "N", 90: "E", 180: "S", 270: "W"}.get(degrees % 360)
            words = quarter or f"{degrees % 360 // 10:02d}"
            art.text(words, x, 92.5, height=8.5, colour=WHITE if quarter else TEXT, align="centre")
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
    art.box(-_BALL_EDGE, _TOP, _BALL_EDGE, _BALL_BOTTOM, colour=FRAME)
    art.box(-_BALL_EDGE, _BALL_BOTTOM, _BALL_EDGE, _BOTTOM, colour=FRAME)
    for side in (-1.0, 1.0):
        art.box(side * _BALL_EDGE, _TOP, side * _TAPE_EDGE, _BOTTOM, colour=FRAME)
    for wing in ([[-58.0, 0.0], [-22.0, 0.0], [-22.0, 8.0]], [[58.0, 0.0], [22.0, 0.0], [22.0, 8.0]]):
        art.line(wing, BACKGROUND, radius=3.0)
        art.line(wing, AMBER, radius=1.8)
    art.line([[-1.0, 0.0], [1.0, 0.0]], BACKGROUND, radius=3.6)
    art.line([[-0.5, 0.0], [0.5, 0.0]], AMBER, radius=2.4)
    for side in (-1.0, 1.0):
        near, far = side * (_BALL_EDGE + 5.0), side * (_TAPE_EDGE - 2.0)
        for y in np.arange(_TOP + 2.0, _TOP + 15.0, 2.0):  # what is thin has nearly square ends
            art.line([[near, y], [far, y]], PANEL, radius=1.6)
    art.text("kn", -_TAPE_EDGE + 5.0, _TOP + 9.0, height=6.0, colour=DIM)
    art.text("alt m", _TAPE_EDGE - 5.0, _TOP + 9.0, height=6.0, colour=DIM, align="right")
    for degrees, length in _BANK_MARKS:
        for side in (-1.0, 1.0):
            mark = [_on_arc(side * degrees, _BANK_RADIUS), _on_arc(side * degrees, _BANK_RADIUS + length)]
            art.line(mark, BACKGROUND, radius=-2.0)
            art.line(mark, WHITE, radius=-1.1)
    art.bar(-_SLIP_REACH - 4.0, _SLIP_Y - 5.5, _SLIP_REACH + 4.0, _SLIP_Y + 5.5, colour=BACKGROUND)
    for side in (-1.0, 1.0):
        art.line([[side * 6.0, _SLIP_Y - 5.5], [side * 6.0, _SLIP_Y + 5.5]], DIM, radius=-0.9)
        x = side * _STANDARD_RATE * _TREND_S * _HEADING_SCALE
        art.line([[x, _BALL_BOTTOM], [x, _BALL_BOTTOM + 5.5]], WHITE, radius=-1.1)
    gauges.draw_faces(art)
    lamps.draw_faces(art)
    return art


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
        (-1.0, f"{np.round(row[COLUMN.airspeed_kt]) + 0.0:.0f}", f"{_tenth(row[COLUMN.airspeed_rate_kt_s]):+.1f} kn/s"),
        (1.0, f"{row[COLUMN.altitude_m]:.1f}", f"{_tenth(row[COLUMN.climb_rate_m_s]):+.1f} m/s"),
    ):
        near, far = side * (_BALL_EDGE + 10.0), side * _TAPE_EDGE
        left, right = min(near, far), max(near, far)
        art.line([[left + 9.0, 0.0], [right - 9.0, 0.0]], BACKGROUND, radius=12.5)
        art.box(left, -13.0, right, 13.0, colour=WHITE)
        art.text(
            text, right - 4.0, 0.0, height=14.0 if len(text) < 5 else 12.0, colour=WHITE, align="right", weight=1.25
        )
        art.bar(left + 5.0, _BOTTOM - 16.0, right - 5.0, _BOTTOM - 2.0, colour=BACKGROUND)
        art.text(rate, 0.5 * (left + right), _BOTTOM - 9.0, height=6.5, colour=TEXT, align="centre")
    bank = float(row[COLUMN.bank_deg])
    tilted = f"  bank {abs(bank):.0f} {'R' if bank > 0.0 else 'L'}" if abs(bank) >= 0.5 else ""
    half = 58.0 if tilted else 34.0
    art.bar(-half, _TOP + 3.0, half, _TOP + 15.0, colour=BACKGROUND)
    words = f"pitch {_tenth(row[COLUMN.pitch_deg]):+.1f}{tilted}"
    art.text(words, 0.0, _TOP + 9.0, height=6.0, colour=WHITE, align="centre")
    middle = 0.5 * (_BALL_BOTTOM + _BOTTOM) + 0.5
    art.line([[-11.0, middle], [11.0, middle]], BACKGROUND, radius=8.5)
    art.box(-19.0, middle - 9.0, 19.0, middle + 9.0, colour=WHITE)
    heading = f"{np.round(row[COLUMN.heading_deg]) % 360.0:03.0f}"
    art.text(heading, 0.0, middle, height=11.0, colour=WHITE, align="centre", weight=1.25)


def _tenth(value: float) -> float:
    """A value as it is written, without the minus of what is nothing."""
    return float(np.round(value, 1)) + 0.0


def _draw_bank_and_slip(art: LineArt, row: FloatArray) -> None:
    """The pointer that the sky carries along the bank scale, and the ball in its tube."""
    bank = float(row[COLUMN.bank_deg])
    corners = (
        (0.0, _BANK_RADIUS - 1.0),
        (-4.5, _BANK_RADIUS - 9.0),
        (4.5, _BANK_RADIUS - 9.0),
        (0.0, _BANK_RADIUS - 1.0),
    )
    pointer = [_on_arc(offset - bank, radius) for offset, radius in corners]
    art.line(pointer, BACKGROUND, radius=-2.4)
    art.line(pointer, WHITE, radius=-1.4)
    x = min(max(-_SLIP_SCALE * float(row[COLUMN.lateral_acceleration]), -_SLIP_REACH), _SLIP_REACH)
    art.line([[x - 0.3, _SLIP_Y], [x + 0.3, _SLIP_Y]], WHITE, radius=4.2)


def _draw_course(art: LineArt, row: FloatArray) -> None:
    """On the heading tape: where the nose will be soon, and where the aircraft goes over the ground."""
    edge = _BALL_EDGE - 3.0
    trend = _HEADING_SCALE * _TREND_S * float(row[COLUMN.turn_rate_deg_s])
    if abs(trend) > 0.5:
        art.line([[0.0, _BALL_BOTTOM + 1.8], [min(max(trend, -edge), edge), _BALL_BOTTOM + 1.8]], GREEN, radius=1.3)
    if abs(row[COLUMN.ground_speed_kt]) > _DRIFT_SHOWN_KT:
        drift = (float(row[COLUMN.track_deg]) - float(row[COLUMN.heading_deg]) + 180.0) % 360.0 - 180.0
        x, y = min(max(_HEADING_SCALE * drift, -edge), edge), _BOTTOM - 4.0
        art.line([[x, y - 3.5], [x + 3.5, y], [x, y + 3.5], [x - 3.5, y], [x, y - 3.5]], GREEN, radius=-1.4)


def _draw_annunciator(art: LineArt, row: FloatArray) -> None:
    """The corridor in words: quiet while clear, framed at a caution, filled at a warning and beyond."""
    level = level_of(row)
    colour, top, bottom = LEVELS[level], _BOTTOM + 5.0, _BOTTOM + 25.0
    side = SIDE_WORDS[int(row[COLUMN.margin_high_kt] < row[COLUMN.margin_low_kt])] if level else ""
    words = "  ".join(word for word in (LEVEL_WORDS[level], side, f"{row[COLUMN.margin_kt]:+.0f} kn") if word)
    filled = level > 1
    if filled:
        art.bar(-_TAPE_EDGE + 10.0, top, _TAPE_EDGE - 10.0, bottom, colour=colour)
    elif level:
        art.box(-_TAPE_EDGE, top, _TAPE_EDGE, bottom, colour=colour, radius=-1.6)
    height, ink = (12.5, BACKGROUND if filled else colour) if level else (9.0, colour)
    art.text(words, 0.0, 0.5 * (top + bottom), height=height, colour=ink, align="centre", weight=1.25)


def _on_arc(angle_deg: float, radius: float) -> FloatArray:
    """A point around the middle of the ball, clockwise from above it."""
    angle = math.radians(angle_deg)
    return radius * np.array([math.sin(angle), -math.cos(angle)])
