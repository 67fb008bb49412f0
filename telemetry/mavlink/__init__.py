"""The aircraft as a MAVLink vehicle: a process of its own between the flight's rows and the ground stations.

The flight pushes rows into a ring and reads sticks and requests from shared memory; everything that talks to a client
happens in the other process, so nothing a client does can hold up a frame.
"""

from telemetry.mavlink.config import DEFAULT_TARGET, Endpoint, HomePosition, MavlinkConfig
from telemetry.mavlink.exchange import Feedback, Request
from telemetry.mavlink.link import InputAges, MavlinkInput, MavlinkLink

__all__ = [
    "DEFAULT_TARGET",
    "Endpoint",
    "Feedback",
    "HomePosition",
    "InputAges",
    "MavlinkConfig",
    "MavlinkInput",
    "MavlinkLink",
    "Request",
]
