"""A flight shown in FlightGear: what a listener gets, and what a process that dies does to the flight."""

from __future__ import annotations

import math
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pymavlink.fgFDM import fgFDM

import scenarios
from rtsim.frame import COLUMN, SIGNAL_COUNT
from scenarios.files.options import Overrides
from scenarios.flight.runner import FlightOutputs
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.flightgear.config import KEFLAVIK, PACKETS_PER_SECOND, WindowConfig
from telemetry.flightgear.link import MOST_RESTARTS, FlightGearLink
from telemetry.log.reader import read_log


class Listener:
    """A socket where FlightGear would be, read in a thread."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.config = WindowConfig(target=Endpoint("127.0.0.1", self.socket.getsockname()[1]))
        self.packets: list[fgFDM] = []
        self.began_s = self.ended_s = 0.0
        self._ends = False
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._ends:
            try:
                data = self.socket.recv(4096)
            except TimeoutError:
                continue
            self.ended_s = time.monotonic()
            self.began_s = self.began_s or self.ended_s
            packet = fgFDM()
            packet.parse(data)
            self.packets.append(packet)

    def close(self) -> None:
        self._ends = True
        self._thread.join()
        self.socket.close()


@pytest.fixture(name="listener")
def _listener() -> Iterator[Listener]:
    listener = Listener()
    yield listener
    listener.close()


def test_a_listener_sees_the_flight_of_the_log(listener: Listener, tmp_path: Path) -> None:
    said: list[str] = []
    outputs = FlightOutputs(log=tmp_path / "turn.parquet", flightgear=listener.config, on_message=said.append)
    overrides = Overrides(duration=2.0, turbulence="moderate", lateral_turbulence=True)
    flight = scenarios.fly("standard_turn_80_75", overrides=overrides, outputs=outputs)
    assert flight.completed
    assert said == [f"FlightGear: sends to {listener.config.target}."]
    time.sleep(0.2)  # what the process sent last is on its way
    listener.close()
    log = read_log(tmp_path / "turn.parquet")
    packets = listener.packets
    # Never more than was promised, whatever the load; fewer where the machine was busy.
    assert 10 < len(packets) < PACKETS_PER_SECOND * (listener.ended_s - listener.began_s) + 5
    latitudes = [math.radians(KEFLAVIK.place(north, 0.0)[0]) for north in log["north_m"]]
    rows = [latitudes.index(packet.get("latitude")) for packet in packets]
    assert rows == sorted(rows)
    assert rows[-1] == len(log["north_m"]) - 1, "the last frame is shown"
    for field, name in (("phi", "bank_deg"), ("theta", "pitch_deg"), ("psi", "heading_deg")):
        sent = [packet.get(field) for packet in packets]
        assert sent == np.radians(log[name][rows]).astype(np.float32).tolist(), name
    assert np.ptp([packet.get("phi") for packet in packets]) > math.radians(0.1)
    assert [packet.get("speedbrake") for packet in packets] == pytest.approx(log["nacelle_deg"][rows] / 90.0, rel=1e-6)


def frame(number: int) -> np.ndarray:
    row = np.zeros(SIGNAL_COUNT)
    row[COLUMN.frame], row[COLUMN.north_m], row[COLUMN.load_factor] = number, number, 1.0
    return row


def until(condition, link: FlightGearLink, *, push: bool = True) -> bool:
    """Go on with the flight until something is so."""
    deadline = time.monotonic() + 20.0
    number = 0
    while not condition() and time.monotonic() < deadline:
        if push:
            link.push(frame(number), np.zeros(TIMING_COUNT))
            number += 1
        time.sleep(0.002)
    return condition()


def test_a_process_that_dies_is_replaced_and_told_of(listener: Listener) -> None:
    said: list[str] = []
    link = FlightGearLink(listener.config, on_message=said.append)
    try:
        for deaths in range(1, MOST_RESTARTS + 2):
            before = len(listener.packets)
            assert until(lambda before=before: len(listener.packets) > before, link)
            assert link.process_id is not None
            os.kill(link.process_id, signal.SIGKILL)
            assert until(lambda deaths=deaths: len(said) == deaths, link)
        assert [text.endswith("another goes on.") for text in said] == [True] * MOST_RESTARTS + [False]
        assert said[-1].endswith("FlightGear stands still, the flight goes on.")
        assert link.process_id is None
        link.push(frame(0), np.zeros(TIMING_COUNT))
    finally:
        link.close()


def test_a_paused_flight_is_sent_again_and_the_process_ends_with_it(listener: Listener) -> None:
    link = FlightGearLink(listener.config)
    assert until(lambda: len(listener.packets) > 0, link)
    seen = len(listener.packets)
    assert until(lambda: len(listener.packets) > seen + 5, link, push=False)
    process = link.process_id
    link.close()
    link.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
