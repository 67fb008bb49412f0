"""Compiled code belongs to one state of the kernels' sources: an edit anywhere leads to another folder."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from rtsim.cli.main import EXIT_INTERNAL_ERROR, run
from rtsim.kernels import cache as kernel_cache

ROOT = Path(__file__).resolve().parents[2]
SOURCES = kernel_cache.kernel_sources(ROOT)


@pytest.fixture
def sources(tmp_path):
    """A copy of what the hash reads."""
    for path in kernel_cache.kernel_sources(ROOT):
        target = tmp_path / "sources" / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return tmp_path / "sources"


def test_an_edit_of_any_kernel_or_constant_changes_the_folder(sources):
    before = kernel_cache.source_hash(sources)
    assert before == kernel_cache.source_hash(ROOT)
    for name in ("rtsim/protection/limiter_kernels.py", "rtsim/measures/metric_kernels.py", "rtsim/units.py"):
        path = sources / name
        text = path.read_text(encoding="utf-8")
        path.write_text(text + "# edited\n", encoding="utf-8")
        assert kernel_cache.source_hash(sources) != before
        path.write_text(text, encoding="utf-8")
    assert kernel_cache.source_hash(sources) == before


def test_all_that_kernels_import_is_part_of_the_hash():
    """Names that kernels take from modules of their own project would otherwise be compiled in unnoticed."""
    found = {path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".") for path in SOURCES}
    missing = set()
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith(("rtsim", "scenarios")):
                continue
            names = {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            modules = {name for name in names if (ROOT / f"{name.replace('.', '/')}.py").is_file()}
            missing |= modules - found
    assert not missing


def test_the_folder_is_made_and_old_ones_are_forgotten(sources, tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    parent = tmp_path / "cache" / "rtsim" / "kernels"
    for name, age in (("old", 40.0), ("recent", 3.0)):
        (parent / name).mkdir(parents=True)
        then = (parent / name).stat().st_mtime - age * 86_400.0
        os.utime(parent / name, (then, then))
    folder = kernel_cache.cache_folder(sources)
    assert folder == parent / kernel_cache.source_hash(sources)
    assert {path.name for path in parent.iterdir()} == {"recent", folder.name}


def test_a_folder_of_the_users_own_takes_the_place(monkeypatch, sources, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "own"))
    assert kernel_cache.cache_folder(sources) == tmp_path / "own" / kernel_cache.source_hash(sources)


def test_where_no_folder_can_be_made_there_is_none(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert kernel_cache.cache_folder(ROOT) is None


CODE = """
import numpy as np
from rtsim.corridor.boundaries import load_corridor
from rtsim.corridor.corridor_kernels import corridor_margins
from rtsim.kernels.kept import kept
out = np.zeros(4)
corridor_margins(load_corridor("design").tables(), 50.0, 1.0, 0.0, out)
print(out.tolist(), kept("piece", b"", lambda: [1, 2]))
"""


def compiled(cache: Path, limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Compile one kernel and keep one piece in a process of its own; with the size that a file may have."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    environment.pop("NUMBA_CACHE_DIR", None)
    code = (
        CODE if limit is None else f"import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, ({limit},) * 2)\n{CODE}"
    )
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, check=True, timeout=120, capture_output=True, text=True
    )


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache with a kernel and a piece in it, and what was said."""
    cache = tmp_path_factory.mktemp("cache")
    return cache, compiled(cache)


def test_kernels_are_kept_in_the_folder(filled):
    cache, done = filled
    folder = cache / "rtsim" / "kernels" / kernel_cache.source_hash(ROOT)
    assert {path.suffix for path in folder.iterdir()} == {".kernel", ".kept"}
    assert not done.stderr


@pytest.mark.parametrize(
    "damage",
    [lambda content: content[:0], lambda content: content[:300], lambda content: content[:-9] + b"!" + content[-8:]],
    ids=["empty", "cut", "flipped"],
)
def test_a_damaged_cache_is_told_once_and_healed(filled, tmp_path, damage):
    """faults.md C1: a damaged cache ended every command, for ever."""
    shutil.copytree(filled[0], tmp_path, dirs_exist_ok=True)
    for path in (tmp_path / "rtsim" / "kernels" / kernel_cache.source_hash(ROOT)).iterdir():
        path.write_bytes(damage(path.read_bytes()))
    first, second = compiled(tmp_path), compiled(tmp_path)
    assert first.stdout == second.stdout == filled[1].stdout
    assert first.stderr.count("is damaged;") == 1
    assert not second.stderr


@pytest.mark.parametrize("odd", ["pipe", "folder", "endless", "circle"])
def test_what_is_no_file_is_no_piece(filled, tmp_path, odd):
    """A pipe in the cache made every command wait for ever."""
    shutil.copytree(filled[0], tmp_path, dirs_exist_ok=True)
    for path in (tmp_path / "rtsim" / "kernels" / kernel_cache.source_hash(ROOT)).iterdir():
        path.unlink()
        {
            "pipe": os.mkfifo,
            "folder": lambda place: place.mkdir(),
            "endless": lambda place: place.symlink_to("/dev/zero"),
            "circle": lambda place: place.symlink_to(place),
        }[odd](path)
    done = compiled(tmp_path)
    assert done.stdout == filled[1].stdout
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("limit", "cache"), [(None, "/dev/null"), (None, "/proc/nowhere"), (64, None), (64, "filled")])
def test_where_nothing_can_be_kept_that_is_told_and_the_work_goes_on(filled, tmp_path, limit, cache):
    """faults.md C2, C3: no folder, one that takes nothing (a file may have 64 bytes, as on a full disk)."""
    before = set(Path(tempfile.gettempdir()).glob("rtsim-*"))
    done = compiled({None: tmp_path, "filled": filled[0]}.get(cache, Path(cache or ".")), limit)
    assert done.stdout == filled[1].stdout
    assert done.stderr.count("\n") == (0 if cache == "filled" else 1), done.stderr
    assert set(Path(tempfile.gettempdir()).glob("rtsim-*")) <= before


def test_what_went_wrong_inside_is_not_taken_for_ctrl_c(monkeypatch, capsys):
    """faults.md C1: the command's parser takes an EOFError for Ctrl-C, exit 130 without a word."""

    def broken(*_: object) -> None:
        raise EOFError("Ran out of input")

    monkeypatch.setattr("scenarios.verdicts.tester.is_test", broken)
    assert run(["test", "hover"]) == EXIT_INTERNAL_ERROR
    assert "EOFError" in capsys.readouterr().err
