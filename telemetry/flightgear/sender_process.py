"""The process that sends a flight to FlightGear: ``python -m telemetry.flightgear.sender_process``.

It reads the ring sixty times a second and sends the newest row, again and again while nothing new comes, so that a
FlightGear that starts late sees a paused flight too. Nobody answers; what is lost is not repeated. Started by
``FlightGearLink``, it ends with its stdin.
"""

from __future__ import annotations

import contextlib
import select
import signal
import socket
import struct
import sys
import time

from rtsim.arrays import FloatArray
from telemetry.exchange.globe import HomePosition
from telemetry.exchange.ring import RingReader
from telemetry.flightgear.config import PACKETS_PER_SECOND, WindowConfig
from telemetry.flightgear.fields import packet_values
from telemetry.flightgear.packet import encode

_PERIOD_S = 1.0 / PACKETS_PER_SECOND


def datagram(row: FloatArray, home: HomePosition) -> bytes | None:
    """The packet that shows a row; None where a number of it is none or fits no field.

    Args:
        row: A row of the flight.
        home: Where the flight began on the globe.
    """
    try:
        values = packet_values(row, home)
        numbers = [value for given in values.values() for value in (given if isinstance(given, tuple) else (given,))]
        # A position that is not a number would stop FlightGear.
        return encode(values) if all(abs(number) < 1e30 for number in numbers) else None
    except (struct.error, ArithmeticError, ValueError):
        return None


def serve(config: WindowConfig, ring: RingReader, sock: socket.socket, *, flight: int = 0) -> None:
    """Send until the flight's process closes its end of a pipe, or is gone; the last row is sent then.

    Args:
        config: Where to, and where the flight began.
        ring: Rows of the flight.
        sock: A UDP socket.
        flight: Descriptor that ends when the flight does.
    """
    address = (config.target.host, config.target.port)
    packet: bytes | None = None
    due, flies = time.monotonic(), True
    while flies:
        flies = not select.select([flight], [], [], max(0.0, due - time.monotonic()))[0]
        due = max(due + _PERIOD_S, time.monotonic())  # a process that stood still sends no burst
        rows = ring.read()
        if len(rows):
            packet = datagram(rows[-1], config.home) or packet
        if packet is not None:
            with contextlib.suppress(OSError):  # nobody listens, or the network is down: the next one may arrive
                sock.sendto(packet, address)


def main() -> int:
    """Send with the settings in the first line of stdin."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    config = WindowConfig.from_json(sys.stdin.buffer.readline().decode())
    ring = RingReader(int(sys.argv[1]))
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setblocking(False)
            serve(config, ring, sock)
    finally:
        ring.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
