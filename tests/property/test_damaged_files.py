"""Damaged files of every kind: nothing but a sentence comes out of a reader, soon, and without eating memory."""

from __future__ import annotations

import json
import random
import shutil
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rtsim.cli.check import file_problems, profile_problems
from rtsim.errors import InputError
from rtsim.frame import SIGNAL_COUNT
from rtsim.lpv.database import GRIDDED
from rtsim.lpv.files import netcdf, storage
from rtsim.lpv.files.mat_layout import unpacked
from rtsim.lpv.files.netcdf import read_database
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.optimization.problem import Evaluation
from rtsim.optimization.search import Record
from scenarios.campaign.chunks import Chunk, ChunkResult
from scenarios.campaign.store import Store
from scenarios.falsification.evaluation import Answer, Query
from scenarios.falsification.record import Record as FlownRecord
from scenarios.flight import replay
from telemetry.log.format import FlightMetadata, LogEvent
from telemetry.log.reader import read_log
from telemetry.log.recorder import Recorder

ROOT = Path(__file__).parents[2]
MEMORY = 300_000_000
"""What a reader may take for any of these small files [bytes]."""
TEXTS = [
    ROOT / "scenarios/library/ep04_wrong_nacelle_command.toml",
    ROOT / "scenarios/library/ep20_nominal_reconversion_turbulence.toml",
    ROOT / "scenarios/campaign/library/misuse.toml",
    ROOT / "examples/second_tiltrotor/search.toml",
    ROOT / "examples/second_tiltrotor/two_thirds.profile.toml",
    *sorted((ROOT / "telemetry/joystick/maps").glob("*.toml"))[:2],
]
VALUES = (
    "nan", "-inf", "-1", "0", "1e308", "9223372036854775807", "'x'", "[]", "{}", "true", "1979-05-27T07:32:00Z",
    "[[1], [2, 3]]", "[1, 'a']", '"\\u001b[31m"', "0x" + "f" * 5000, "1" * 5000,
)  # fmt: skip


def damaged(data: bytes, dice: random.Random) -> bytes:
    """The same with bytes or bits changed, cut off, taken out or put in."""
    changed, how = bytearray(data), dice.randrange(6)
    place = dice.randrange(len(data))
    if how == 0:
        return bytes(changed[:place])
    if how == 1:
        for _ in range(dice.choice([1, 1, 5, 100])):
            changed[dice.randrange(len(data))] = dice.randrange(256)
    elif how == 2:
        for _ in range(dice.choice([1, 1, 5, 20])):
            changed[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
    elif how == 3:
        del changed[place : place + dice.randrange(1, 40)]
    elif how == 4:
        changed[place:place] = dice.randbytes(dice.randrange(1, 40))
    else:  # sizes stand near the beginning
        changed[dice.randrange(min(len(data), 3000))] = dice.choice([0, 127, 128, 255])
    return bytes(changed)


def reworded(text: str, dice: random.Random) -> str:
    """The same with lines lost, doubled, or saying something else."""
    lines = text.split("\n")
    for _ in range(dice.choice([1, 1, 3])):
        place, how = dice.randrange(len(lines)), dice.randrange(5)
        key, equals, _ = lines[place].partition("=")
        if how == 0:
            lines.insert(place, lines[dice.randrange(len(lines))])
        elif how == 1:
            lines[place] = ""
        elif how == 2:
            lines[place] = dice.choice(["[start]", "[[classes]]", "[air]", "[case.a.input]", "[axes]", "[x]"])
        elif equals:
            lines[place] = f"{key} = {dice.choice(VALUES)}" if how == 3 else f"x{lines[place]}"
    return "\n".join(lines)


def refuses(read, *arguments) -> bool:
    """Whether a reader refuses, with a sentence; anything else that it raises fails the test."""
    try:
        read(*arguments)
    except InputError as error:
        return str(error).endswith((".", "?"))
    return False


@pytest.fixture(scope="module", autouse=True)
def _made():
    """What is made once for an installation is no cost of a damaged file."""
    for path in TEXTS:
        file_problems(str(path))


@pytest.fixture(autouse=True)
def _bounded():
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MEMORY


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_texts(tmp_path, path):
    dice, refused = random.Random(path.stem), 0
    target = tmp_path / f"given{''.join(path.suffixes)}"
    text = path.read_text(encoding="utf-8")
    for number in range(30):
        data = damaged(text.encode(), dice) if number % 3 == 0 else reworded(text, dice).encode()
        target.write_bytes(data)
        problems = file_problems(str(target))
        assert all(problem.startswith(str(target)) for problem in problems)
        refused += bool(problems)
    assert refused > 10


@pytest.fixture(scope="module")
def small_database():
    """The shipped database on a coarse grid, one layer, pilots included."""
    whole = load_database()
    speeds, angles = list(range(0, 48, 12)), [0, 12, 25]
    level = [whole.level_layer]
    return replace(
        whole,
        lateral=None,
        layer_acceleration=whole.layer_acceleration[level],
        airspeed=whole.airspeed[speeds],
        nacelle=whole.nacelle[angles],
        rotor_speed=whole.rotor_speed[angles],
        flap=whole.flap[np.ix_(speeds, angles)],
        pilot={
            name: replace(pilot, arrays={key: array[speeds][:, angles] for key, array in pilot.arrays.items()})
            for name, pilot in whole.pilot.items()
        },
        **{name: getattr(whole, name)[level][:, speeds][:, :, angles] for name in GRIDDED},
    )


@pytest.mark.parametrize("packed", [True, False])
def test_matlab_databases(tmp_path, small_database, packed, monkeypatch):
    monkeypatch.setattr(storage, "kept", lambda _name, _key, make: make())
    whole, target, dice = tmp_path / "whole.mat", tmp_path / "damaged.mat", random.Random(packed)
    save_database(small_database, whole)
    data = whole.read_bytes() if packed else unpacked(whole.read_bytes(), largest=10**9)
    refused = 0
    for _ in range(40):
        target.write_bytes(damaged(data, dice))
        refused += refuses(lambda: profile_problems(load_database(target)))
    assert refused > (35 if packed else 12)


def test_netcdf_databases(tmp_path, small_database, monkeypatch):
    whole, target, dice = tmp_path / "whole.nc", tmp_path / "damaged.nc", random.Random(3)
    save_database(small_database, whole)
    data = whole.read_bytes()
    assert sum(refuses(read_database, _written(target, damaged(data, dice))) for _ in range(8)) >= 7
    # The library's loops and crashes are met in the other process; here it is told of them.
    monkeypatch.setattr(netcdf.netcdf_trial, "__file__", str(_written(tmp_path / "loops.py", b"import os; os.abort()")))
    with pytest.raises(InputError, match=r"whole\.nc: is damaged, or no NetCDF database: reading it does not end"):
        read_database(whole)


def _written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def test_records_of_searches(tmp_path):
    path, numbers, dice = tmp_path / "search.npz", np.random.default_rng(1), random.Random(4)
    record = Record(path, "this search")
    for _ in range(3):
        record.add(Evaluation(*(numbers.random((4, width)) for width in (5, 1, 7))))
    data = path.read_bytes()
    assert len(Record(path, "this search").generations) == 3
    refused = sum(refuses(Record, _written(path, damaged(data, dice) or b"x"), "this search") for _ in range(150))
    assert refused > 100


def test_records_of_searches_for_broken_laws(tmp_path):
    dice, queries = random.Random(7), [Query(0, np.array([0.4, 0.5]))] * 3
    numbers = np.array([1.0])
    one = Answer(numbers, numbers, 1, 0.0, 0.0, 0.0, b"\1" * 62, b"\2" * 74, "", 0.1)
    flown = []

    def fly(asked):
        flown.append(asked)
        return [one] * len(asked)

    FlownRecord(tmp_path, {"law": "full"}, fly, pieces="generations")(queries)
    [piece] = (tmp_path / "generations").iterdir()
    data = piece.read_bytes()
    for _ in range(100):
        piece.write_bytes(damaged(data, dice))
        try:
            found = FlownRecord(tmp_path, {"law": "full"}, fly, pieces="generations")(queries)
        except InputError:
            continue
        assert len(found) == 3
    assert len(flown) > 40


def test_pieces_of_campaigns(tmp_path):
    dice, chunk = random.Random(5), Chunk(0, 0, 2)
    identity = {"laws": ["full", "off"], "metrics": ["a", "b", "c"], "properties": ["p"]}
    store = Store(tmp_path, identity)
    store.save(ChunkResult(chunk, np.ones((2, 2, 3)), np.ones((2, 2, 1)), ((0, 1, "late"),), np.zeros(2)))
    [piece] = (tmp_path / "chunks").iterdir()
    data = piece.read_bytes()
    found = [store.load(chunk) for _ in range(100) if _written(piece, damaged(data, dice))]
    assert found.count(None) > 60
    assert all(np.array_equal(result.metrics, np.ones((2, 2, 3))) for result in found if result is not None)
    for text in (b"", b"{", b"[]", b"\xff", b"\xff\xfe{\0}\0"):
        _written(tmp_path / "campaign.json", text)
        with pytest.raises(InputError, match="--fresh to begin anew"):
            Store(tmp_path, identity)
    (tmp_path / "campaign.json").unlink()
    with pytest.raises(InputError, match="is missing beside pieces of a campaign"):
        Store(tmp_path, identity)
    assert Store(tmp_path, identity, fresh=True).load(chunk) is None


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("log") / "whole.parquet"
    metadata = FlightMetadata("hover", "", "hash", 0, 50.0, versions={"rtsim": "1"}, setup={"flight": {}})
    recorder = Recorder(path, metadata, live=False)
    for number in range(3):
        data = {"row": number, "aid": "rate_damping", "on": True}
        recorder.event(LogEvent(number, number / 50.0, "aid", "rate damping on", data=data))
    recorder.push_block(np.random.default_rng(3).normal(size=(120, SIGNAL_COUNT)))
    recorder.close({"end_reason": "done"})
    return path


def test_logs(tmp_path, log):
    dice, refused, target = random.Random(6), 0, tmp_path / "damaged.parquet"
    files = sorted(entry.name for entry in log.iterdir())
    for number in range(60):
        shutil.copytree(log, target)
        file = target / files[number % len(files)]
        file.write_bytes(damaged(file.read_bytes(), dice))
        refused += refuses(read_log, target)
        shutil.rmtree(target)
    assert refused > 20


@pytest.mark.parametrize("name", ["Thumbs.db", "desktop.ini", ".DS_Store", "part-2.docx", "._part-000001.parquet"])
def test_foreign_files_in_a_log_are_passed_over(tmp_path, log, name):
    target = tmp_path / "flight.parquet"
    shutil.copytree(log, target)
    (target / "copy").mkdir()
    (target / "copy" / "picture.png").write_bytes(b"no parquet")
    (target / name).write_bytes(b"no parquet either")
    assert np.array_equal(read_log(target).rows, read_log(log).rows, equal_nan=True)
    (target / "part-000001.parquet").unlink()
    with pytest.raises(InputError, match=r"part-000001\.parquet: is missing between the parts"):
        read_log(target)


@pytest.mark.parametrize(
    "event",
    [
        {"kind": "aid", "data": {"aid": "rate_damping", "on": True}},
        {"kind": "aid", "data": {"row": "3", "aid": "rate_damping", "on": True}},
        {"kind": "aid", "data": {"row": -1, "aid": "rate_damping", "on": True}},
        {"kind": "aid", "data": {"row": 1, "aid": "autoland", "on": True}},
        {"kind": "flaps", "data": {"row": 1, "angle": float("nan")}},
        {"kind": "throttle", "data": {"row": 1, "share": [1]}},
        {"kind": "failure", "data": {"row": 1, "fault": {"kind": "rust"}, "on": True}},
        {"kind": "gust", "data": {"row": 1, "start": "now"}},
        {"kind": "law", "data": {"row": 1}},
        {"kind": "pilot", "data": {"row": 1}},
    ],
)
def test_events_that_cannot_be_repeated_are_told(log, tmp_path, event):
    target = tmp_path / "flight.parquet"
    shutil.copytree(log, target)
    line = json.dumps({"frame": 1, "time_s": 0.25, "text": "something", **event})
    (target / "_events.jsonl").write_text(line + "\n", encoding="utf-8")
    flight = read_log(target)
    with pytest.raises(
        InputError, match=rf"the event '{event['kind']}' at 0\.25 s cannot be repeated: .*restore the file"
    ):
        replay.fly_recording(None, flight.history, flight.events)
    with pytest.raises(InputError, match="is damaged, or no account of how the log was flown"):
        replay.replay_log(target)
