"""The MAVLink process: ``python -m telemetry.mavlink.vehicle_process``, started by ``MavlinkLink``.

It owns the socket. Work per turn is bounded, so that a flood costs a fixed share of one core and nothing else: after a
busy moment the process looks at the socket every 2 ms instead of waking for each datagram.
"""

from __future__ import annotations

import contextlib
import fcntl
import select
import signal
import socket
import struct
import sys
import time
import traceback
from collections.abc import Callable

from rtsim.errors import InputError, RtsimError
from telemetry.exchange.ring import RingReader
from telemetry.mavlink.config import MavlinkConfig
from telemetry.mavlink.exchange import DISCARDED, FAULTS, HEARTBEAT, PORT, READY, STOP, Exchange
from telemetry.mavlink.framing import LARGEST_DATAGRAM
from telemetry.mavlink.peers import Address
from telemetry.mavlink.vehicle import Vehicle

RECEIVE_BUDGET_S = 0.003
"""Longest time spent on incoming datagrams in one turn [s]."""
_FLOOD_DATAGRAMS_PER_S = 1500.0
_FLOOD_WINDOW_S = 0.05
_FLOOD_PAUSE_S = 0.002
_RECEIVE_BUFFER_BYTES = 1 << 19
_LAST_PACKET_TIME = 0x8907  # SIOCGSTAMPNS of Linux: when the datagram read last had arrived
_TIMESPEC = struct.Struct("@qq")


class Receiver:
    """Takes datagrams from the socket within a time budget and notices floods."""

    def __init__(self, sock: socket.socket, receive: Callable[[bytes, Address, int, float], object]) -> None:
        """Connect.

        Args:
            sock: A non-blocking UDP socket.
            receive: Told bytes, sender, time of arrival (monotonic [ns]) and now (monotonic [s]).
        """
        self._socket, self._receive = sock, receive
        self._window_end, self._in_window = 0.0, 0
        self.flooded = False
        """More comes in than any ground station sends."""
        self._stamp = bytearray(_TIMESPEC.size)
        self._kernel_stamps = True

    def drain(self) -> None:
        """Read until nothing is left or the budget is used up."""
        sock, end = self._socket, time.monotonic() + RECEIVE_BUDGET_S
        while True:
            now = time.monotonic()
            if now >= end:
                self._count(now, 0)
                return
            try:
                datagram, address = sock.recvfrom(LARGEST_DATAGRAM)
            except (BlockingIOError, InterruptedError):
                self._count(now, 0)
                return
            except OSError:
                continue  # an ICMP error of something sent earlier
            self._count(now, 1)
            self._receive(datagram, address, self._arrival_ns(), now)

    def _count(self, now: float, datagrams: int) -> None:
        if now >= self._window_end:
            self.flooded = self._in_window > _FLOOD_DATAGRAMS_PER_S * _FLOOD_WINDOW_S
            self._in_window, self._window_end = 0, now + _FLOOD_WINDOW_S
        self._in_window += datagrams

    def _arrival_ns(self) -> int:
        """When the kernel got the datagram just read, so that the wait in the socket counts as age too."""
        now = time.monotonic_ns()
        if self._kernel_stamps:
            try:
                fcntl.ioctl(self._socket, _LAST_PACKET_TIME, self._stamp)
            except OSError:
                self._kernel_stamps = False
            else:
                seconds, nanoseconds = _TIMESPEC.unpack(self._stamp)
                waited = time.time_ns() - (seconds * 1_000_000_000 + nanoseconds)
                if 0 <= waited < 1_000_000_000:
                    now -= waited
        return now


def open_socket(config: MavlinkConfig) -> socket.socket:
    """Open the vehicle's socket.

    Args:
        config: Address and port to receive on.

    Raises:
        InputError: The port is taken or not allowed.
    """
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        sock.bind((config.bind_host, config.bind_port))
    except OSError as failure:
        sock.close()
        raise InputError(
            f"the port cannot be opened ({failure.strerror})",
            key="--mavlink-bind",
            value=f"{config.bind_host}:{config.bind_port}",
            mend="choose another port",
        ) from failure
    sock.setblocking(False)
    return sock


def serve(config: MavlinkConfig, exchange: Exchange, ring: RingReader, sock: socket.socket, *, flight: int = 0) -> None:
    """Be the vehicle until asked to stop, or until the flight's process is gone.

    Args:
        config: Settings of the vehicle.
        exchange: Shared memory to the flight.
        ring: Rows of the flight.
        sock: The vehicle's socket.
        flight: Descriptor that ends when the flight's process does.
    """

    def send(datagram: bytes, address: Address) -> None:
        with contextlib.suppress(OSError):  # a full buffer or an unreachable station: telemetry is not repeated
            sock.sendto(datagram, address)

    vehicle = Vehicle(config, exchange, send=send, now=time.monotonic())
    receiver = Receiver(
        sock,
        lambda datagram, address, received_ns, now: _guarded(
            exchange, vehicle.receive, datagram, address, received_ns=received_ns, now=now
        ),
    )
    header = exchange.header
    header[PORT] = sock.getsockname()[1]
    header[READY] = 1
    due = 0.0
    while not header[STOP]:
        pause = max(0.0, due - time.monotonic())
        if receiver.flooded:
            time.sleep(min(max(pause, 0.0005), _FLOOD_PAUSE_S))
        waited_for: list[int] = [flight] if receiver.flooded else [sock.fileno(), flight]
        if flight in select.select(waited_for, [], [], 0.0 if receiver.flooded else pause)[0]:
            break
        receiver.drain()
        now = time.monotonic()
        header[HEARTBEAT] += 1
        if now >= due:
            vehicle.observe(ring.read(), now)
            due = now + 0.02
            tick = _guarded(exchange, vehicle.tick, now)
            if isinstance(tick, float):
                due = tick
    _guarded(exchange, vehicle.farewell)


def _guarded(exchange: Exchange, action: Callable[..., object], *arguments: object, **options: object) -> object:
    """Run something that handles foreign data; a fault in it is told once and costs one datagram, not the process."""
    try:
        return action(*arguments, **options)
    except Exception:  # noqa: BLE001 - no packet may end the vehicle
        exchange.header[DISCARDED] += 1
        exchange.header[FAULTS] += 1
        if exchange.header[FAULTS] == 1:
            traceback.print_exc()
        return None


def main() -> int:
    """Serve with the settings on stdin; errors for the user go to stdout as one line."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    ring_descriptor, exchange_descriptor = map(int, sys.argv[1:3])
    config = MavlinkConfig.from_json(sys.stdin.readline())
    try:
        exchange, ring = Exchange(exchange_descriptor), RingReader(ring_descriptor)
        try:
            with open_socket(config) as sock:
                serve(config, exchange, ring, sock)
        finally:
            ring.close()
            exchange.close()
    except RtsimError as failure:
        sys.stdout.write(f"{failure}\n")
        sys.stdout.flush()
        return failure.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
