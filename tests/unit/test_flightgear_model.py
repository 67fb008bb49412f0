"""The aircraft for FlightGear: files that read well, parts that are there and turn the right way about."""

from __future__ import annotations

import shlex
import subprocess
from collections import deque
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rtsim.aircraft.profile import xv15_profile
from rtsim.aircraft.xv15.model import Xv15
from rtsim.cli.main import run
from rtsim.cli.options import OPTIONAL_VALUES, with_values
from rtsim.systems.ground import load_ground_tables
from telemetry.flightgear.ac3d import names
from telemetry.flightgear.config import DEFAULT_TARGET, KEFLAVIK, WindowConfig
from telemetry.flightgear.files import AIRCRAFT, START_SCRIPT, start_command, write_aircraft
from telemetry.flightgear.model import movements, objects
from telemetry.view import undercarriage

SET_BY_PACKETS = {
    *(f"surface-positions/{name}-pos-norm" for name in ("elevator", "flap", "left-aileron", "right-aileron", "rudder")),
    "surface-positions/speedbrake-pos-norm",
    *(f"engines/engine[{number}]/rpm" for number in range(2)),
    *(f"gear/gear[{number}]/{what}-norm" for number in range(3) for what in ("position", "compression")),
}
"""Properties that FlightGear sets from the fields that we fill (its native_structs.hxx)."""


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flight gear")
    write_aircraft(folder, listen=WindowConfig().target, home=KEFLAVIK)
    return folder


class Ac3d:
    """A reader of AC3D files, as strict as the format."""

    def __init__(self, text: str) -> None:
        self.lines = deque(text.splitlines())
        assert self.lines.popleft() == "AC3Db"
        self.materials = 0
        while self.lines[0].startswith("MATERIAL "):
            words = shlex.split(self.lines.popleft())
            assert [words[place] for place in (2, 6, 10, 14, 18, 20)] == ["rgb", "amb", "emis", "spec", "shi", "trans"]
            assert all(0.0 <= float(word) <= 1.0 for word in words[3:6])
            self.materials += 1
        self.vertices: dict[str, np.ndarray] = {}
        self.above: dict[str, str] = {}
        assert self.lines.popleft() == "OBJECT world"
        self.kids("world")
        assert not self.lines

    def kids(self, above: str) -> None:
        word, count = self.lines.popleft().split()
        assert word == "kids"
        for _ in range(int(count)):
            self.child(above)

    def child(self, above: str) -> None:
        kind = self.lines.popleft()
        name = shlex.split(self.lines.popleft())[1]
        assert name not in self.above
        self.above[name] = above
        if kind == "OBJECT poly":
            assert self.lines.popleft().startswith("crease ")
            self.vertices[name] = self.triangles()
        else:
            assert kind == "OBJECT group"
        self.kids(name)

    def triangles(self) -> np.ndarray:
        points = [self.lines.popleft() for _ in range(int(self.lines.popleft().removeprefix("numvert ")))]
        for _ in range(int(self.lines.popleft().removeprefix("numsurf "))):
            assert self.lines.popleft().startswith("SURF 0x")
            assert 0 <= int(self.lines.popleft().removeprefix("mat ")) < self.materials
            assert self.lines.popleft() == "refs 3"
            for _ in range(3):
                assert 0 <= int(self.lines.popleft().split()[0]) < len(points)
        x, y, z = np.array([point.split() for point in points], dtype=float).T
        return np.stack([x, -z, y], 1)  # aft, right, up

    def centre(self, name: str) -> np.ndarray:
        return 0.5 * (self.vertices[name].min(0) + self.vertices[name].max(0))


@pytest.fixture(name="model", scope="module")
def _model(folder: Path) -> Ac3d:
    return Ac3d((folder / AIRCRAFT / "Models" / "xv15.ac").read_text())


@pytest.fixture(name="animations", scope="module")
def _animations(folder: Path) -> list[ET.Element]:
    return ET.parse(folder / AIRCRAFT / "Models" / "xv15.xml").getroot().findall("animation")


def test_the_model_has_the_parts_and_the_size_of_an_xv15(model: Ac3d) -> None:
    assert set(model.above) == set(names(objects()))
    assert np.ptp(model.vertices["fuselage"][:, 0]) == pytest.approx(13.2, abs=0.3)
    assert np.ptp(model.vertices["wing"][:, 1]) == pytest.approx(32.17 * 0.3048, abs=0.01)
    for side, sign in (("left", -1.0), ("right", 1.0)):
        assert np.ptp(model.vertices[f"disc_{side}"][:, 1:], axis=0) == pytest.approx([7.62, 7.62], abs=0.02)
        assert model.centre(f"disc_{side}")[1] == pytest.approx(sign * 193.0 * 0.0254, abs=1e-3)
        assert {model.above[f"{part}_{side}"] for part in ("pod", "blades", "disc")} == {f"nacelle_{side}"}
    assert model.centre("elevator")[0] > 6.0  # aft
    assert model.centre("tail")[2] > model.centre("wheels_nose")[2]  # up


def test_every_animation_moves_parts_by_properties_that_packets_set(model: Ac3d, animations: list[ET.Element]) -> None:
    assert len(animations) == len(movements())
    for animation in animations:
        moved = [node.text for node in animation.findall("object-name")]
        assert moved
        assert set(moved) <= set(model.above)
        assert {node.text for node in animation.iter("property")} <= SET_BY_PACKETS
    assert {node.text for one in animations for node in one.iter("property")} == SET_BY_PACKETS


def moved(animations: list[ET.Element], name: str, path: str, value: float, point: np.ndarray) -> np.ndarray:
    """Where an animation takes a point of a part."""
    found = [
        one
        for one in animations
        if one.findtext("type") in {"rotate", "translate"}
        and one.findtext("object-name") == name
        and one.findtext("property") == path
    ]
    (animation,) = found
    axis = np.array([float(animation.findtext(f"axis/{letter}")) for letter in "xyz"])
    if (table := animation.find("interpolation")) is not None:
        entries = [(float(entry.findtext("ind")), float(entry.findtext("dep"))) for entry in table]
        amount = float(np.interp(value, *zip(*entries, strict=True)))
    else:
        amount = float(animation.findtext("factor")) * value + float(animation.findtext("offset-deg") or 0.0)
    if animation.findtext("type") == "translate":
        return point + amount * axis
    centre = np.array([float(animation.findtext(f"center/{letter}-m")) for letter in "xyz"])
    angle, arm = np.radians(amount), point - centre
    along = axis * (arm @ axis)
    return centre + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)


def test_nacelles_and_surfaces_turn_the_right_way(model: Ac3d, animations: list[ET.Element]) -> None:
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hub = model.centre(f"disc_{side}")
        up = moved(animations, f"nacelle_{side}", "surface-positions/speedbrake-pos-norm", 1.0, hub)
        assert up - hub == pytest.approx([1.4225, 0.0, 1.4225], abs=1e-3)  # from ahead of the pivot to above it
        edge = model.vertices[f"flap_{side}"][model.vertices[f"flap_{side}"][:, 0].argmax()]
        assert moved(animations, f"flap_{side}", "surface-positions/flap-pos-norm", 0.5, edge)[2] < edge[2] - 0.1
        edge = model.vertices[f"flaperon_{side}"][model.vertices[f"flaperon_{side}"][:, 0].argmax()]
        drooped = moved(animations, f"flaperon_{side}", "surface-positions/flap-pos-norm", 40.0 / 75.0, edge)
        assert drooped[2] < edge[2] - 0.1
        # Stick to the right: the packet has +1 on the left, -1 on the right; the right one goes up.
        banked = moved(animations, f"flaperon_{side}", f"surface-positions/{side}-aileron-pos-norm", sign, edge)
        assert (banked[2] - edge[2]) * sign < -0.05
        edge = model.vertices[f"rudder_{side}"][model.vertices[f"rudder_{side}"][:, 0].argmax()]
        assert moved(animations, f"rudder_{side}", "surface-positions/rudder-pos-norm", 1.0, edge)[1] > edge[1] + 0.02
    edge = model.vertices["elevator"][model.vertices["elevator"][:, 0].argmax()]
    assert moved(animations, "elevator", "surface-positions/elevator-pos-norm", 1.0, edge)[2] < edge[2] - 0.05


def test_wheels_fold_into_the_aircraft_and_stand_on_the_ground(model: Ac3d, animations: list[ET.Element]) -> None:
    for number, name in enumerate(("nose", "left", "right")):
        foot = model.vertices[f"wheels_{name}"][:, 2].min()
        lowest = model.centre(f"wheels_{name}") * [1, 1, 0] + [0, 0, foot]
        assert moved(animations, f"gear_{name}", f"gear/gear[{number}]/position-norm", 1.0, lowest) == pytest.approx(
            lowest
        )
        assert moved(animations, f"gear_{name}", f"gear/gear[{number}]/position-norm", 0.0, lowest)[2] > -1.0
        pressed = moved(animations, f"wheels_{name}", f"gear/gear[{number}]/compression-norm", 0.5, lowest)
        # Standing it leans by less than a degree over a wheelbase of 4.75 m.
        assert pressed[2] == pytest.approx(-undercarriage.STANDING_HEIGHT, abs=0.02)


def test_the_wheels_are_those_of_the_flight() -> None:
    profile = xv15_profile()
    gear = profile.systems.table("gear")
    for place, axle, tyre, stroke in (
        ("nose", undercarriage.NOSE_AXLE, undercarriage.NOSE_TYRE, undercarriage.NOSE_STROKE),
        ("main", undercarriage.MAIN_AXLE, undercarriage.MAIN_TYRE, undercarriage.MAIN_STROKE),
    ):
        assert list(axle[::2]) == list(gear.numbers(f"{place}_axle_SL_WL_in", low=0.0, high=1e3, count=2))
        assert tyre == gear.number(f"{place}_tire_diameter_in", low=0.0, high=1e3)
        assert stroke / 0.0254 == pytest.approx(gear.number(f"{place}_stroke_in", low=0.0, high=1e3))
    assert 2.0 * undercarriage.MAIN_AXLE[1] == gear.number("main_track_in", low=0.0, high=1e3)
    standing = load_ground_tables(profile, Xv15.load().tables).standing
    assert standing == pytest.approx(undercarriage.STANDING_HEIGHT, abs=1e-3)


def test_the_aircraft_file_names_the_model(folder: Path) -> None:
    root = ET.parse(folder / AIRCRAFT / f"{AIRCRAFT}-set.xml").getroot()
    model = root.findtext("sim/model/path")
    assert (folder / model.removeprefix("Aircraft/")).exists()
    assert root.findtext("sim/flight-model") == "null"
    eye = [float(root.findtext(f"sim/view/config/{axis}-offset-m")) for axis in "xyz"]
    assert eye == pytest.approx([0.3, 0.54, -4.2], abs=0.05)  # right, up, aft of the centre of gravity


def test_the_script_starts_what_the_command_says(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "fgfs").write_text('#!/bin/sh\nprintf "%s\\n" "$DBUS_FATAL_WARNINGS" "$@"\n')
    (tmp_path / "fgfs").chmod(0o755)
    done = subprocess.run(
        ["sh", folder / START_SCRIPT, "--disable-sound"],
        env={"PATH": f"{tmp_path}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    words = start_command(folder, listen=WindowConfig().target, home=KEFLAVIK)
    assert done.stdout.splitlines() == ["0", *words[1:], "--disable-sound"]
    assert "--native-fdm=socket,in,60,127.0.0.1,5510,udp" in words
    # Both would listen on every address, and whoever reaches them may run programs here.
    assert not any(word.startswith(("--telnet", "--props", "--httpd")) for word in words)


def test_the_command_writes_and_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        run(["flightgear", "--out", str(tmp_path / "new"), "--listen", "127.0.0.1:5599", "--origin", "21.3,-157.9,4"])
        == 0
    )
    out = capsys.readouterr().out
    assert str(tmp_path / "new" / START_SCRIPT) in out
    assert "rtsim fly --flightgear 127.0.0.1:5599 --origin 21.3,-157.9,4" in out
    script = (tmp_path / "new" / START_SCRIPT).read_text()
    assert "127.0.0.1,5599,udp" in script
    assert "--lat=21.300000" in script
    (tmp_path / "file").write_text("")
    assert run(["flightgear", "--out", str(tmp_path / "file")]) == 4


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("fly --flightgear", "fly --flightgear=127.0.0.1:5510"),
        ("fly --flightgear hover", "fly --flightgear=127.0.0.1:5510 hover"),
        ("fly --flightgear --headless", "fly --flightgear=127.0.0.1:5510 --headless"),
        ("fly --flightgear 10.0.0.2:5510 hover", None),
        ("fly --flightgear=10.0.0.2 hover", None),
        ("fly -- --flightgear", None),
    ],
)
def test_the_address_may_be_left_out(words: str, completed: str | None) -> None:
    assert with_values(words.split()) == (completed or words).split()


def test_the_default_address_is_declared_alike() -> None:
    assert OPTIONAL_VALUES["--flightgear"] == DEFAULT_TARGET


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--flightgear", "--speed", "max"], "needs a paced flight"),
        (["--flightgear", "127.0.0.1:99999"], "is no UDP address"),
        (["--flightgear=no such host"], "the name cannot be resolved"),
        (["--origin", "somewhere"], "is no place on the globe"),
        (["--origin", "10,20"], "add --flightgear or --mavlink"),
    ],
)
def test_mistakes_are_one_sentence(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fly", "hover", "--headless", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert sentence in error
