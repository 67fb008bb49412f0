"""Whatever somebody gives to be read is opened in one place, whose refusals are sentences with file, place and mend."""

from __future__ import annotations

import os
import threading
import zipfile

import numpy as np
import pytest

from rtsim import outside
from rtsim.errors import InputError
from rtsim.lpv.files.storage import load_database
from rtsim.optimization.search import Record
from rtsim.outside import read_arrays, read_text, regular_file, understanding
from rtsim.toml_file import parse_toml
from scenarios.campaign.spec import load_campaign
from scenarios.files.loader import load_scenario
from telemetry.log.reader import read_log
from telemetry.mavlink.config import read_signing_key
from telemetry.mavlink.parameters import ParameterStore

READERS = {
    "a.toml": load_scenario,
    "b.toml": load_campaign,
    "c.nc": load_database,
    "d.mat": load_database,
    "e.npz": lambda path: Record(path, "search"),
    "f.toml": lambda path: ParameterStore.every_aid().load(path),
    "g.key": read_signing_key,
}


@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file_is_refused_in_the_same_words(tmp_path, name, monkeypatch):
    monkeypatch.setattr(outside, "PATIENCE_S", 0.05)
    path, reader = tmp_path / name, READERS[name]
    path.mkdir()
    with pytest.raises(InputError, match=rf"{name}: is a directory; name a "):
        reader(path)
    path.rmdir()
    os.mkfifo(path)
    with pytest.raises(InputError, match=rf"{name}: is a pipe or a device"):
        reader(path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(InputError, match=rf"{name}: is (a pipe or a device|too large)"):
        reader(path)
    path.unlink()
    path.symlink_to(path)
    if name[0] not in "ef":  # where there is none they begin anew
        with pytest.raises(InputError, match=rf"{name}: cannot be read: too many levels of symbolic links"):
            reader(path)
        path.unlink()
        path.symlink_to(tmp_path / "nowhere")
        with pytest.raises(InputError, match=rf"{name}: is a link to a file that does not exist"):
            reader(path)
    path.unlink()
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # takes no room
    with pytest.raises(InputError, match=rf"{name}: is too large for a .*; allowed: at most \d+ bytes"):
        reader(path)


def test_a_pipe_that_ends_is_a_text(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_bytes(b"\xef\xbb\xbfa = 1\n" + b"# so\n" * 30_000))
    writer.start()
    assert read_text(pipe, noun="scenario").startswith("a = 1\n# so\n")
    writer.join()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("a = 1".encode("utf-16"), "is UTF-16 text; allowed: UTF-8; save it as UTF-8"),
        ("a = 1".encode("utf-16-be"), "line 1: byte 0 is 0"),
        ("a = 1".encode("utf-32"), "is UTF-32 text"),
        ("# ä\nb = 'ü'".encode("latin-1"), "line 1: byte 2 is not UTF-8"),
        (b"a = 1\nb = '\0'", "line 2: byte 11 is 0"),
        (b" \n", "is empty; write a scenario into it"),
    ],
)
def test_other_texts_are_refused_with_the_place(tmp_path, data, words):
    (tmp_path / "a.toml").write_bytes(data)
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        read_text(tmp_path / "a.toml", noun="scenario")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = " + "1" * 5000, "is not valid TOML: exceeds the limit"),
        ("[t]\na = [1, 0x" + "f" * 5000 + "]", r"t.a\[1\]: is too large a number; allowed: whole numbers of 64 bits"),
        ("a" + ".a" * 100_000 + " = 1", "is nested too deeply"),
    ],
)
def test_numbers_and_keys_without_end_are_refused(text, words):
    with pytest.raises(InputError, match=words):
        parse_toml(text, file="a.toml")


def test_a_message_keeps_to_its_line():
    error = InputError("is odd", file="a\x1b[31m.toml", key="k\ny", value="x" * 10_000)
    assert str(error).startswith("a\\x1b[31m.toml: k\\ny: is odd (got 'xxx")
    assert len(str(error)) < 400


def test_what_a_library_raises_is_one_sentence_and_ours_passes():
    with (
        pytest.raises(InputError, match=r"^a\.bin: is damaged, or no picture: 'size' is missing; paint it again\.$"),
        understanding("picture", file="a.bin", mend="paint it again"),
    ):
        raise KeyError("size")
    with pytest.raises(InputError, match="ours"), understanding("picture", file="a.bin", mend="paint it again"):
        raise InputError("ours")


def test_arrays_are_measured_before_they_are_unpacked(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", bytes(5_000_000))
    with pytest.raises(InputError, match=r"bomb\.npz: is too large for a record; allowed: at most 1000000 bytes"):
        read_arrays(path, noun="record", largest=1_000_000, mend="delete it")
    np.savez(path, a=np.array([object()], dtype=object))
    with pytest.raises(InputError, match="is damaged, or no record: Object arrays cannot be loaded"):
        read_arrays(path, noun="record", largest=1_000_000, mend="delete it")
    with pytest.raises(InputError, match="is no path"):
        regular_file(3, noun="record", largest=1)
    with pytest.raises(InputError, match="is no name of a file"):
        regular_file("a\0b", noun="record", largest=1)
    with pytest.raises(InputError, match="is no path"):
        read_log(None)
