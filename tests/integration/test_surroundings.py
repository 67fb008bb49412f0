"""What a user has set for other programs changes no result and ends no command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scenarios.files.loader import load_scenario
from scenarios.flight.mavlink_options import MavlinkOptions, default_parameter_file, mavlink_config
from telemetry.mavlink.exchange import Exchange
from telemetry.mavlink.parameters import ParameterStore
from telemetry.mavlink.vehicle import Vehicle
from telemetry.view import viewer

ROOT = Path(__file__).resolve().parents[2]
ODD_SETTINGS = "figure.dpi: 7\nfont.size: 99\nsvg.fonttype: odd\nbackend: nonsense\naxes.facecolor: red\n"
SURROUNDINGS: dict[str, dict[str, str]] = {
    "terminal and language": {
        "TERM": "dumb",
        "COLUMNS": "abc",
        "LINES": "-3",
        "NO_COLOR": "1",
        "FORCE_COLOR": "1",
        "TZ": "nonsense/zone",
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONIOENCODING": "ascii",
    },
    "python and pictures": {
        "PYTHONWARNINGS": "error",
        "PYTHONHASHSEED": "7",
        "PYTHONBREAKPOINT": "nonsense",
        "MPLBACKEND": "nonsense",
        "MATPLOTLIBRC": "odd",
    },
    "numba and threads": {
        "NUMBA_CAPTURED_ERRORS": "odd",
        "NUMBA_NUM_THREADS": "0",
        "NUMBA_OPT": "0",
        "NUMBA_BOUNDSCHECK": "1",
        "OMP_NUM_THREADS": "abc",
        "TMPDIR": "/nonexistent",
    },
}


def rtsim(folder: Path, *arguments: str, **variables: str) -> str:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MPL", "PYTHON", "OMP"))}
    done = subprocess.run(
        [sys.executable, "-m", "rtsim", *arguments],
        cwd=folder,
        env={**environment, "PYTHONPATH": str(ROOT), **variables},
        capture_output=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    assert b"Traceback" not in done.stderr
    return done.stdout.decode()


@pytest.fixture(name="usual", scope="module")
def _usual(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, bytes]:
    folder = tmp_path_factory.mktemp("usual")
    return results(folder)


def results(folder: Path, **variables: str) -> tuple[str, bytes]:
    """The hash of a flight, and a picture."""
    text = rtsim(folder, *["fly", "hover", "--headless", "--speed", "max", "--duration", "0.5", "--json"], **variables)
    rtsim(folder, "corridor", "--plot", "corridor.png", **variables)
    return json.loads(text.splitlines()[-1])["history_sha256"], (folder / "corridor.png").read_bytes()


@pytest.mark.parametrize("name", SURROUNDINGS)
def test_results_do_not_depend_on_what_is_set_for_others(tmp_path: Path, usual: tuple[str, bytes], name: str) -> None:
    (tmp_path / "odd").write_text(ODD_SETTINGS)
    assert results(tmp_path, **SURROUNDINGS[name]) == usual


@pytest.mark.parametrize("settings", [ODD_SETTINGS.encode(), b"font.size: \xff\xfe\n"])
def test_a_settings_file_in_the_current_folder_changes_no_picture(
    tmp_path: Path, usual: tuple[str, bytes], settings: bytes
) -> None:
    (tmp_path / "matplotlibrc").write_bytes(settings)
    rtsim(tmp_path, "corridor", "--plot", "corridor.png")
    assert (tmp_path / "corridor.png").read_bytes() == usual[1]


@pytest.fixture(name="homeless")
def _homeless(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Neither HOME nor an entry for the user."""

    def home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", home)
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_without_a_home_mavlink_flies_and_says_that_parameters_are_not_kept(homeless: Path) -> None:
    assert default_parameter_file() is None
    config, warning = mavlink_config(MavlinkOptions(), load_scenario("hover"))
    assert config.parameter_file is None
    assert warning is not None
    assert "no home folder" in warning
    config, warning = mavlink_config(MavlinkOptions(parameter_file=homeless / "mine.toml"), load_scenario("hover"))
    assert config.parameter_file == str(homeless / "mine.toml")
    assert warning is None


def test_without_a_home_the_view_has_a_directory_for_its_time(homeless: Path) -> None:
    viewer._configuration.cache_clear()
    directory = Path(viewer.quiet_environment()["XDG_CONFIG_HOME"])
    assert directory.parent == homeless
    assert viewer.quiet_environment()["XDG_CONFIG_HOME"] == str(directory)
    viewer.remove_temporary()
    viewer._configuration.cache_clear()
    assert list(homeless.iterdir()) == []


def test_a_home_that_may_not_be_looked_into_costs_parameters_only(monkeypatch: pytest.MonkeyPatch) -> None:
    def load(store: ParameterStore, path: str) -> None:
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(ParameterStore, "load", load)
    config, _ = mavlink_config(MavlinkOptions(), load_scenario("hover"))
    exchange, sent = Exchange(), []
    vehicle = Vehicle(config, exchange, send=lambda data, _: sent.append(data), now=0.0)
    vehicle.tick(0.1)
    assert any(b"Parameters not loaded" in data for data in sent)
    exchange.close()
