"""The history of a flight: all rows in order, in memory or not, whatever the disk does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtsim.frame import SIGNAL_COUNT
from scenarios.flight import sinks


def grown(pieces: list[int]) -> tuple[np.ndarray, sinks.History]:
    """A history that got single rows (1) and blocks, some of which follow one another in memory."""
    rows = np.random.default_rng(1).random((sum(pieces), SIGNAL_COUNT))
    history, at = sinks.History(), 0
    for number, piece in enumerate(pieces):
        part = rows[at : at + piece]
        if piece == 1:
            history.append(part[0])
        else:
            history.extend(part if number % 3 else part.copy())
        at += piece
    return rows, history


@given(st.lists(st.sampled_from([1, 1, 1, 2, 3, 7]), max_size=60), st.integers(0, 12))
def test_nothing_is_lost_and_all_is_in_order(pieces, memory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sinks, "MEMORY_ROWS", memory)
        patch.setattr(sinks, "_CHUNK", 4)
        rows, history = grown(pieces)
        np.testing.assert_array_equal(history.rows(), rows)
        np.testing.assert_array_equal(history.rows(), rows)
        assert not history.rows().flags.writeable


def test_a_long_flight_keeps_little_in_memory(monkeypatch):
    monkeypatch.setattr(sinks, "MEMORY_ROWS", 20)
    monkeypatch.setattr(sinks, "_CHUNK", 10)
    _, history = grown([1] * 500)
    assert sum(map(len, history.chunks)) <= 40


@pytest.mark.parametrize("full_from", [0, 3])
def test_a_full_disk_loses_nothing(monkeypatch, full_from):
    monkeypatch.setattr(sinks, "MEMORY_ROWS", 20)
    monkeypatch.setattr(sinks, "_CHUNK", 10)
    real, calls = sinks.tempfile.TemporaryFile, []

    class Full:
        def __init__(self, **options):
            self._file = real(**options)

        def write(self, content):
            calls.append(1)
            if len(calls) > full_from:
                self._file.write(bytes(content)[:100])
                raise OSError(28, "No space left on device")
            return self._file.write(content)

        def __getattr__(self, name):
            return getattr(self._file, name)

    monkeypatch.setattr(sinks.tempfile, "TemporaryFile", Full)
    rows, history = grown([1] * 300)
    np.testing.assert_array_equal(history.rows(), rows)
