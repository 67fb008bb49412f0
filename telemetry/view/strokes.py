"""Line art for the flat views: a stroke font, and a collection of coloured strips that becomes one log call.

Rerun's labels have one small size and a grey box; a pilot needs large plain numerals. So they are drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import rerun as rr

from rtsim.arrays import FloatArray

Colour = tuple[int, int, int] | tuple[int, int, int, int]
Align = Literal["left", "centre", "right"]

# Each glyph: strips of points; a point is two digits, column 0-4 from the left and row 0-6 from the top.
_GLYPHS = {
    "0": "103041453616050110", "1": "112026 1636", "2": "01103041420646", "3": "011030414233 133344453616 1605",
    "4": "36300444", "5": "40000312324345361605", "6": "413010010516364544331304", "7": "004026",
    "8": "133342413010010213 1304051636454433", "9": "423313020110304145361605",
    "A": "0602204246 0444", "B": "06003041423303 3344453606", "C": "4130100105163645", "D": "00062644422000",
    "E": "40000646 0333", "F": "400006 0333", "G": "41301001051636454323", "H": "0006 4046 0343",
    "I": "1030 2026 1636", "J": "4045361605", "K": "0006 400346", "L": "000646", "M": "0600234046", "N": "06004640",
    "O": "103041453616050110", "P": "06003041423303", "Q": "103041453616050110 2446", "R": "06003041423303 2346",
    "S": "413010010213334445361605", "T": "0040 2026", "U": "000516364540", "V": "002640", "W": "0016233640",
    "X": "0046 4006", "Y": "002340 2326", "Z": "00400646",
    "-": "0343", "+": "0343 2125", ".": "2526", ":": "2122 2425", "/": "4006", "%": "4006 0010110100 3545463635",
    "\N{DEGREE SIGN}": "1030321210", "(": "30121436", ")": "10323416", "=": "0242 0444", " ": "",
}  # fmt: skip
_STRIPS = {
    character: [
        np.array([[int(strip[i]), int(strip[i + 1])] for i in range(0, len(strip) - 1, 2)], dtype=float)
        for strip in glyph.split()
    ]
    for character, glyph in _GLYPHS.items()
}
_ADVANCE = 5.6


def text_width(text: str, height: float) -> float:
    """Width of a line of text.

    Args:
        text: The text.
        height: Height of its capitals.
    """
    return max(0.0, (len(text) * _ADVANCE - 1.6) * height / 6.0)


class LineArt:
    """Strips of different colours and widths, logged together."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.strips: list[FloatArray] = []
        """Polylines, each of shape (points, 2)."""
        self.colours: list[Colour] = []
        """Colour of each strip."""
        self.radii: list[float] = []
        """Half width of each strip in scene units; negative values are half widths in points of the screen."""

    def line(
        self, points: Sequence[Sequence[float] | FloatArray] | FloatArray, colour: Colour, *, radius: float = -1.0
    ) -> None:
        """Add a polyline.

        Args:
            points: Its corners, x right and y down.
            colour: Its colour.
            radius: Half its width: in scene units, or negative in points of the screen.
        """
        self.strips.append(np.asarray(points, dtype=float))
        self.colours.append(colour)
        self.radii.append(radius)

    def bar(self, left: float, top: float, right: float, bottom: float, *, colour: Colour) -> None:
        """Fill a rectangle (with one thick line, whose round ends overlap its short sides).

        Args:
            left: Left edge.
            top: Upper edge.
            right: Right edge.
            bottom: Lower edge.
            colour: Its colour.
        """
        width, height = right - left, bottom - top
        if width >= height:
            middle = 0.5 * (top + bottom)
            self.line([[left, middle], [right, middle]], colour, radius=0.5 * height)
        else:
            middle = 0.5 * (left + right)
            self.line([[middle, top], [middle, bottom]], colour, radius=0.5 * width)

    def box(
        self, left: float, top: float, right: float, bottom: float, *, colour: Colour, radius: float = -1.0
    ) -> None:
        """Outline a rectangle.

        Args:
            left: Left edge.
            top: Upper edge.
            right: Right edge.
            bottom: Lower edge.
            colour: Its colour.
            radius: Half the width of the line.
        """
        self.line([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], colour, radius=radius)

    def text(
        self,
        text: str,
        x: float,
        y: float,
        *,
        height: float,
        colour: Colour,
        align: Align = "left",
        weight: float = 1.0,
    ) -> None:
        """Write a line of text.

        Args:
            text: The text; letters are shown as capitals.
            x: Its left edge, middle or right edge, as ``align`` says.
            y: Its vertical middle.
            height: Height of the capitals.
            colour: Its colour.
            align: Which part of the text stands at x.
            weight: Boldness, 1 is normal.
        """
        scale = height / 6.0
        left = x - {"left": 0.0, "centre": 0.5, "right": 1.0}[align] * text_width(text, height)
        for index, character in enumerate(text.upper()):
            origin = np.array([left + index * _ADVANCE * scale, y - 0.5 * height])
            for strip in _STRIPS.get(character, []):
                self.line(origin + scale * strip, colour, radius=0.42 * scale * weight)

    def archetype(self, draw_order: float) -> Any:
        """What to log.

        Args:
            draw_order: Higher is nearer to the eye.
        """
        if not self.strips:
            return rr.LineStrips2D([], draw_order=draw_order)
        ends = np.cumsum([0, *map(len, self.strips)], dtype=np.int32)
        points = rr.encodings.Vec2DBatch(np.concatenate(self.strips)).as_arrow_array()
        strips: Any = pa.ListArray.from_arrays(ends, points, type=_STRIPS_TYPE)
        colours = np.array([_packed(*colour) for colour in self.colours], dtype=np.uint32)
        return rr.LineStrips2D(strips, colors=colours, radii=np.array(self.radii), draw_order=draw_order)


# Arrays of the right type are taken as they are; given one by one, strips took half of the view's time.
_STRIPS_TYPE = rr.components.LineStrip2DBatch([]).as_arrow_array().type


def _packed(red: int, green: int, blue: int, opacity: int = 255) -> int:
    return red << 24 | green << 16 | blue << 8 | opacity
