"""Compiled code belongs to one state of the kernels' sources: an edit anywhere leads to another folder."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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


def test_a_folder_of_the_users_own_is_left_alone(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "somewhere")
    assert kernel_cache.cache_folder(ROOT) is None


def test_where_no_folder_can_be_made_numba_finds_its_own(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert kernel_cache.cache_folder(ROOT) is None


def test_kernels_are_compiled_into_the_folder(tmp_path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)
    code = (
        "import numpy as np\n"
        "from rtsim.corridor.boundaries import load_corridor\n"
        "from rtsim.corridor.corridor_kernels import corridor_margins\n"
        "corridor_margins(load_corridor('design').tables(), 50.0, 1.0, np.zeros(4))\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, check=True, timeout=120)
    made = list(
        (tmp_path / "rtsim" / "kernels" / kernel_cache.source_hash(ROOT)).rglob("corridor_kernels.corridor_mar*.nbc")
    )
    assert made
