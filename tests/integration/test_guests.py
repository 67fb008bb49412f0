"""A user's code in our processes: what it prints, raises, changes and costs (faults.md G, D1)."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import xml.etree.ElementTree as ET
from contextlib import suppress
from pathlib import Path

import pytest

from rtsim.cli.main import run
from rtsim.guests import LONGEST_WORDS, Visit, readable, shown, words_of
from rtsim.protection.guard import guarded_call
from scenarios.verdicts import tester

TRIAL = """
format = 1
name = "mine"
title = "Hover"
duration_s = 2
[start]
condition = "hover"
[trial]
kind = "nominal"
"""
LAWS = r"""
import ctypes, os, random, signal, sys, time
import beside                      # a module beside it is found

print("imported", flush=True)

class Good:
    def step(self, sensors, command, margins, dt):
        return command, []

class Prints(Good):
    def step(self, *given):
        print("hello"); os.write(1, b"from below\n"); sys.stdout.write("{not json")
        return super().step(*given)

class Moves(Good):
    def step(self, *given):
        os.chdir("/"); signal.signal(signal.SIGINT, signal.SIG_IGN); sys.stdout = None
        return super().step(*given)

class Raises(Good):
    def step(self, *given):
        raise ValueError("red \x1b[31m\x00 two\nlines" + 4000 * "x")

class Works(Good):
    def step(self, *given):
        begun = time.thread_time()
        while time.thread_time() < begun + 0.025:
            pass
        return super().step(*given)

class Sleeps(Good):
    def step(self, sensors, command, margins, dt):
        if sensors.time < 0.3:
            time.sleep(0.05)
        return command, []

class Odd(BaseException):
    def __str__(self):
        raise ValueError

class Hard:
    def step(self, *given):
        raise Odd

class Exits:
    def step(self, *given):
        raise GeneratorExit("boom" + 5000 * "x")

class Stays:
    def step(self, sensors, reference, dt):
        if sensors.time == 0.0:
            import threading
            threading.Thread(target=time.sleep, args=(600,)).start()
            sys.stdout.close()
        import rtsim.command
        return rtsim.command.Command(0.0, 0.73, 0.0)

class Flies:
    def step(self, sensors, reference, dt):
        os.chdir("/"); print("flying")
        raise RuntimeError("\x1b[2J" + 2000 * "y")
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(TRIAL, encoding="utf-8")
    (tmp_path / "guestlaws.py").write_text(LAWS, encoding="utf-8")
    (tmp_path / "beside.py").write_text("", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    for name in ("guestlaws", "beside"):
        sys.modules.pop(name, None)


def command(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run rtsim in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "rtsim", *words], capture_output=True, text=True, timeout=300, check=False,
        env={**os.environ, **environment},
    )  # fmt: skip


@pytest.mark.parametrize(("law", "code"), [("Prints", 0), ("Moves", 0), ("Raises", 1)])
def test_answers_for_machines_stay_whole(law, code, folder):
    """G3: what a law prints, in Python or below it, spoilt the JSON; a folder it changed to got the reports."""
    ended = command("test", "mine.toml", "--protection", f"guestlaws:{law}", "--json", "--junit", "j.xml")
    assert ended.returncode == code, ended.stderr
    answer = json.loads(ended.stdout)
    assert answer["scenarios"] == 1
    ET.parse(folder / "j.xml")
    assert "imported" in ended.stderr
    assert "\x1b[31m" not in ended.stderr + ended.stdout
    assert max(len(line) for line in ended.stderr.splitlines()) < 1000
    assert ("from below" in ended.stderr) == (law == "Prints")


def test_a_pilot_is_a_guest_too(folder, capsys):
    assert run(["fly", "hover", "--headless", "--speed", "max", "--duration", "1", "--pilot", "guestlaws:Flies"]) == 1
    told = "".join(capsys.readouterr())
    assert "raised RuntimeError" in told
    assert "\x1b[2J" not in told
    assert Path.cwd() == folder


@pytest.mark.parametrize(
    ("option", "name", "code", "words"),
    [
        ("--pilot", "Hard", 1, "raised Odd"),
        ("--pilot", "Exits", 1, "raised GeneratorExit"),
        ("--nacelle", "Hard", 0, "raised Odd"),
        ("--nacelle", "Exits", 0, "raised GeneratorExit"),
    ],
)
def test_whatever_a_pilot_or_nacelle_law_raises_is_told(option, name, code, words, capsys):
    fly = ["fly", "hover", "--headless", "--speed", "max", "--duration", "1", option, f"guestlaws:{name}", "--json"]
    assert run(fly) == code
    told = capsys.readouterr()
    assert words in told.err
    assert len(told.err) < 5000
    assert json.loads(told.out)["frames"] > 0


@pytest.mark.parametrize(
    "text",
    [
        "class Own(BaseException): pass\nraise Own",
        "class Law:\n    def __init__(self): raise GeneratorExit\n    def step(self, *given): pass",
    ],
)
def test_whatever_a_module_or_class_raises_is_one_sentence(text, folder, capsys):
    (folder / "hardmodule.py").write_text(text, encoding="utf-8")
    for option in ("--pilot", "--nacelle", "--protection"):
        assert run(["fly", "hover", "--headless", "--speed", "max", option, "hardmodule:Law"]) == 2
        told = capsys.readouterr().err
        assert told.count("rtsim: error: ") == 1
        assert "Traceback" not in told
        sys.modules.pop("hardmodule", None)


def test_threads_and_closed_streams_of_a_guest_keep_nobody(folder):
    ended = command(
        "fly", "hover", "--headless", "--speed", "max", "--duration", "1", "--pilot", "guestlaws:Stays", "--json"
    )
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["frames"] == 250
    assert folder


def test_a_trial_is_flown_with_the_law_that_the_flight_names(folder):
    text = TRIAL.replace("[start]", '[flight]\nprotection = "governor"\n[start]')
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    assert tester.Tester().run(the_scenario()).law == "governor"


@pytest.mark.parametrize("law", ["Works", "Sleeps"])
def test_how_fast_a_law_is_decides_nothing(law):
    """G1: a law failed because the machine was busy. Its CPU time is told, and judged by nobody."""
    case = tester.Tester(law=f"guestlaws:{law}").run(the_scenario())
    assert case.verdict == "passed"
    assert ("CPU time" in case.note) == (law == "Works")
    assert case.flight.history_sha256 == tester.Tester(law="guestlaws:Good").run(the_scenario()).flight.history_sha256


def the_scenario():
    from scenarios.files.loader import load_scenario

    return load_scenario("mine.toml")


def test_a_replay_asks_before_it_runs_what_a_log_names(folder, capsys):
    """G2: replaying a stranger's log imported the module that it names from the current folder."""
    fly = ["fly", "mine.toml", "--headless", "--speed", "max", "--log", "a.parquet", "--protection"]
    assert run([*fly, "off,guestlaws:Good"]) == 0
    sys.modules.pop("guestlaws", None)
    capsys.readouterr()
    assert run(["replay", "a.parquet"]) == 2
    told = "".join(capsys.readouterr())
    assert "guestlaws:Good" in told
    assert "--trust" in told
    assert "imported" not in told
    assert run(["replay", "a.parquet", "--trust"]) == 0


@pytest.mark.parametrize("key", ["pilot", "nacelle"])
def test_a_trial_refuses_by_name_what_it_would_not_fly(key, folder, capsys):
    """A's kind: a trial's pilot or nacelle law of one's own was left out without a word."""
    text = TRIAL.replace("[start]", f'[flight]\n{key} = "guestlaws:Good"\n[start]')
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    assert run(["test", "mine.toml"]) == 2
    assert f"flight.{key}" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["random", "telemetry", "colorsys", "rtsim", "numpy"])
def test_what_only_lies_in_the_folder_is_not_imported(name, folder):
    """D1: a file of that name was executed in place of the module, once a law had been looked for here."""
    (folder / f"{name}.py").write_text("raise SystemExit(99)\n", encoding="utf-8")
    script = f"from rtsim.protection.laws import load_laws; load_laws('guestlaws:Good'); import {name}"
    ended = subprocess.run(
        [sys.executable, "-P", "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert ended.returncode == 0, ended.stderr


def test_the_house_is_as_it_was(folder, monkeypatch):
    handler = signal.getsignal(signal.SIGTERM)
    stream = sys.stdout
    with suppress(KeyError), Visit():
        os.chdir("/")
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        sys.stdout = sys.stderr
        raise KeyError
    assert Path.cwd() == folder
    assert signal.getsignal(signal.SIGTERM) is handler
    assert sys.stdout is stream
    gone = folder / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with Visit():
        pass


class Odd:
    def __repr__(self) -> str:
        raise ValueError

    __str__ = __repr__


class OddError(Exception):
    __str__ = Odd.__repr__


def test_words_of_strangers_are_readable():
    assert readable("a\x1b[31mb\r\nc\u2028d\ud800") == "a [31mb c d"
    assert len(readable("x" * 10_000)) == LONGEST_WORDS
    assert shown(Odd()) == "a Odd"
    assert words_of(OddError()) == "OddError"
    assert words_of(ValueError()) == "ValueError"


def test_a_call_without_end_is_ended_by_its_cpu_time():
    class Endless:
        def step(self, *_):
            while True:
                pass

    from rtsim.command import Command

    answer = guarded_call(Endless(), *[Command(0.0, 0.0, 0.0)] * 3, dt=0.02, limit=0.1, live=False)  # type: ignore[arg-type]
    assert answer.failure == "interrupted"
    assert "CPU time" in answer.text
