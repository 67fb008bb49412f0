"""All TOML files are read by one reader, whose every refusal is a sentence with a way out."""

from __future__ import annotations

from typing import Annotated

import pytest
from pydantic import Field

from rtsim.aircraft.profile import read_profile
from rtsim.errors import InputError, OutputError
from rtsim.optimization.spec import load_spec
from rtsim.pilot.cases import load_cases
from rtsim.strict import Strict, checked
from rtsim.toml_file import read_toml
from rtsim.whole_file import write_whole
from scenarios.campaign.spec import load_campaign
from scenarios.files.loader import load_scenario
from telemetry.joystick.stick_map import load_stick_map

READERS = (load_scenario, load_campaign, load_spec, load_cases, read_profile, load_stick_map)


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "does not exist; check the path"),
        (b"a = ", r"is not valid TOML: invalid value \(at (line 1|end of document).*; correct this line"),
        (b"a = \xff", r"is not a text file \(line 1: byte 4 is not UTF-8\); save it as UTF-8"),
        (b"a = " + b"[" * 50_000, "is nested too deeply; write flat tables"),
        (b"#" * 4_000_001, "is too large for a .*; allowed: at most [14]000000 bytes"),
    ],
)
def test_every_reader_says_the_same(tmp_path, reader, content, words):
    file = tmp_path / "given.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=rf"given\.toml: {words}"):
        reader(file)


@pytest.mark.parametrize("reader", READERS)
def test_a_directory_is_no_file(tmp_path, reader):
    with pytest.raises(InputError, match=r"is a directory; name a .* file"):
        reader(tmp_path)


def test_a_mark_before_the_text_is_passed_over(tmp_path):
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert read_toml(tmp_path / "marked.toml", noun="scenario") == {"a": 1}


class Inner(Strict):
    gain: Annotated[float, Field(ge=0.5, allow_inf_nan=False)] = 1.0
    name: Annotated[str, Field(pattern="^[a-z]+$")] = "a"


class Outer(Strict):
    parts: Annotated[list[Inner], Field(max_length=2)]


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({}, "a.toml: parts: is missing; add it."),
        ({"parts": 3}, "a.toml: parts: must be a list (got 3); correct the value."),
        (
            {"parts": [{"gian": 1.0}]},
            "a.toml: parts[0].gian: is not a known key; allowed: gain, name; perhaps 'gain' is meant.",
        ),
        (
            {"parts": [{"gain": 0.1}]},
            "a.toml: parts[0].gain: is out of range (got 0.1); allowed: at least 0.5; choose a value in this range.",
        ),
        (
            {"parts": [{"name": "A"}]},
            "a.toml: parts[0].name: is misspelled (got 'A'); allowed: the pattern ^[a-z]+$; correct the value.",
        ),
    ],
)
def test_what_is_wrong_in_a_table_is_one_sentence(data, sentence):
    with pytest.raises(InputError) as caught:
        checked(Outer, data, file="a.toml")
    assert str(caught.value) == sentence


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path):
    target = tmp_path / "out.json"
    write_whole(target, "old")
    with pytest.raises(OutputError, match=r"none.out\.json: cannot be written: No such file"):
        write_whole(tmp_path / "none" / "out.json", "new")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]
