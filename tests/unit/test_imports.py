"""Imports go one way: units, errors, frame, command at the bottom, the command line on top (docs/architecture.md)."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# A part may import from its own layer's parts only itself, and from every part of a lower layer.
LAYERS = (
    ("rtsim.units", "rtsim.places"),
    ("rtsim.errors",),
    ("rtsim.frame",),
    ("rtsim.command",),
    ("rtsim.choices",),
    ("rtsim.random_streams", "rtsim.plugins", "rtsim.toml_file", "rtsim.strict", "rtsim.whole_file"),
    ("rtsim.kernels",),
    ("rtsim.aircraft", "rtsim.programme", "telemetry"),
    ("rtsim.corridor", "rtsim.atmosphere"),
    ("rtsim.lpv",),
    ("rtsim.nacelle",),
    ("rtsim.pilot", "rtsim.aids", "rtsim.faults", "rtsim.protection", "rtsim.sticks"),
    ("rtsim.systems",),
    ("rtsim.loop",),
    ("rtsim.measures", "rtsim.realtime"),
    ("rtsim.optimization",),
    ("rtsim.analysis",),
    ("scenarios",),
    ("rtsim.cli", "rtsim.__main__"),
)
LEVEL = {part: level for level, parts in enumerate(LAYERS) for part in parts}
TELEMETRY_MAY_IMPORT = {
    "rtsim.units",
    "rtsim.errors",
    "rtsim.frame",
    "rtsim.command",
    "rtsim.toml_file",
    "rtsim.strict",
    "rtsim.whole_file",
    "telemetry",
}
OUTPUT_PARTS = {"telemetry", "scenarios"}


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules():
    files = [path for package in ("rtsim", "telemetry", "scenarios") for path in sorted((ROOT / package).rglob("*.py"))]
    assert len(files) > 10
    return files


def part_of(name):
    """The part of the architecture a module belongs to; None for what stands outside (other distributions)."""
    pieces = name.split(".")
    if pieces[0] in OUTPUT_PARTS:
        return pieces[0]
    if pieces[0] != "rtsim":
        return None
    return "rtsim" if len(pieces) == 1 else f"rtsim.{pieces[1]}"


def imported_names(path):
    """Every absolute module name a file imports, inside functions and type-checking blocks too."""
    package = module_name(path).split(".")
    if path.name != "__init__.py":
        package = package[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            target = ".".join([*base, *([node.module] if node.module else [])])
            # "from rtsim import units" imports the module rtsim.units.
            yield from (f"{target}.{alias.name}" for alias in node.names) if target == "rtsim" else [target]


def backward_arrows(path):
    here = part_of(module_name(path))
    if here == "rtsim":  # the package itself only hands out names, lazily
        return []
    faults = []
    for name in imported_names(path):
        there = part_of(name)
        if there is None or here in {there, "rtsim.__main__"}:
            continue
        if there in {"rtsim", "rtsim.__version__"}:  # the version stands at the very bottom
            continue
        if here == "telemetry":
            allowed = there in TELEMETRY_MAY_IMPORT
        elif there in OUTPUT_PARTS and here.startswith("rtsim.") and here != "rtsim.cli":
            allowed = False
        else:
            allowed = LEVEL[there] < LEVEL[here]
        if not allowed:
            faults.append(f"{module_name(path)} ({here}) imports {name} ({there})")
    return faults


@pytest.mark.parametrize("path", modules(), ids=module_name)
def test_no_import_goes_backward(path):
    here = part_of(module_name(path))
    assert here == "rtsim" or here in LEVEL, f"{here} has no place in the layers: add it to LAYERS"
    assert backward_arrows(path) == []


def test_a_backward_arrow_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    wrong = tmp_path / "rtsim" / "corridor" / "wrong.py"
    wrong.parent.mkdir(parents=True)
    wrong.write_text(
        "from rtsim import lpv\n\ndef f():\n    import telemetry.exchange.ring\n    from ..pilot import x\n"
    )
    faults = backward_arrows(wrong)
    assert len(faults) == 3
    sideways = tmp_path / "telemetry" / "wrong.py"
    sideways.parent.mkdir()
    sideways.write_text("from rtsim.corridor import load_corridor\nfrom rtsim.frame import SIGNALS\n")
    assert len(backward_arrows(sideways)) == 1
