"""Colours of the view, so that one meaning has one colour everywhere."""

from __future__ import annotations

BACKGROUND = (13, 16, 21)
PANEL = (20, 24, 31)
FRAME = (62, 70, 82)
GRID = (44, 51, 61)
TEXT = (214, 220, 228)
DIM = (132, 142, 156)
CYAN = (80, 210, 235)
"""What the flight is asked for: references, bugs, targets."""
WHITE = (245, 247, 250)
"""What the aircraft does now."""
GREEN, AMBER, ORANGE, RED = (90, 220, 130), (255, 196, 60), (255, 140, 50), (255, 78, 78)
LEVELS = (GREEN, AMBER, ORANGE, RED)
"""Corridor clear, caution, warning, exceedance."""
LOW_SIDE, HIGH_SIDE = (255, 176, 66), (255, 92, 92)
"""Low-speed and high-speed boundary of the corridor."""
ACTING = (232, 121, 249)
"""What a protection law takes from the hands."""
WIND = (178, 206, 255)
"""Where the air goes."""
TRAIL = (96, 165, 250)
GHOST = (244, 114, 182)
"""A second flight over the one that is shown."""
LEFT_ROTOR, RIGHT_ROTOR = (206, 212, 220), (96, 165, 250)
"""No colour of an alarm."""
SKY, GROUND = (44, 104, 178), (108, 76, 44)
"""Of the attitude ball."""
SERIES = (
    (96, 165, 250), (255, 176, 66), (90, 220, 130), (244, 114, 182), (167, 139, 250), (45, 212, 191), (250, 220, 90),
    (248, 113, 113), (190, 200, 212),
)  # fmt: skip
"""Lines of a plot, in order."""
