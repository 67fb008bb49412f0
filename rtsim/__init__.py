"""rtsim: a real-time, pilot-in-the-loop simulator of the Bell XV-15 tiltrotor.

Its names (``__init__.pyi``) are loaded when first used, so that importing the package costs nothing.

Words that mean the same in every module; a function says only what is special about its own:

Legend:
    airspeed: Airspeed, horizontal and signed [m/s].
    altitude: Height above the ground [m].
    app: The ``rtsim`` command.
    condition: The flight condition.
    database: An LPV database in memory: trims, linear models, pilot gains.
    dt: Length of a frame [s].
    file: The file that a text or table came from, for messages.
    flight: The flight.
    nacelle: Nacelle angle, as ``nacelle_angle``.
    nacelle_angle: Nacelle angle, pi/2 helicopter, 0 airplane [rad].
    now: Monotonic time [s].
    profile: The aircraft; None: the XV-15.
    row: A frame's signals, shape (SIGNAL_COUNT,).
    rows: Frames one after the other, shape (frames, SIGNAL_COUNT).
    scenario: What is flown.
    sensors: What pilots and laws may know of the aircraft, shape (SENSOR.size,) where it is an array.
    state: What a part keeps from frame to frame.
    tables: What a part reads: prepared once, never written.
    timing: Wall-clock columns of the frame before, shape (TIMING_COUNT,); None where the flight is not paced.
    u: The aircraft's inputs (nu,).
    x: The aircraft's state (nx,).
"""

from rtsim.early import end_by_signals

end_by_signals()
del end_by_signals

from rtsim.lazy import names_of  # noqa: E402

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = names_of(__name__, __file__)
