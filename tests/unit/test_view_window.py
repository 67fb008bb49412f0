"""The window on the world and the words of the view: surroundings, lamps, band, ghosts, and lines as arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rerun as rr

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.view import cockpit, instruments, lamps, scene, surroundings, viewer
from telemetry.view.aircraft import GHOST_OPACITY, Aircraft
from telemetry.view.colours import ACTING, AMBER, GHOST, LEVELS, RED
from telemetry.view.options import ViewOptions
from telemetry.view.strokes import LineArt, text_width


def row_of(**signals: float) -> FloatArray:
    row = np.zeros(SIGNAL_COUNT)
    row[COLUMN.engine_power_available_shp] = 3000.0
    for name, value in signals.items():
        row[getattr(COLUMN, name)] = value
    return row


class Recording:
    """Notes what is logged, and what of it once for all."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, object]] = []
        self.static: list[tuple[str, object]] = []

    def log(self, path: str, archetype: object, *, static: bool = False) -> None:
        (self.static if static else self.logged).append((path, archetype))


def array(component: object) -> np.ndarray:
    return np.array(component.as_arrow_array().to_pylist())  # type: ignore[attr-defined]


HEALTHY = row_of(flapping_left_deg=3.0, mast_torque_right_inlb=9e4, power_shp=1500.0, engine_power_shp=1500.0)


def test_no_lamp_is_lit_while_nothing_is_wrong() -> None:
    assert lamps.lit(HEALTHY) == {}


@pytest.mark.parametrize(
    ("signals", "word", "colour"),
    [
        ({"flapping_right_deg": 6.1}, "FLAPPING", AMBER),
        ({"mast_torque_left_inlb": 131_000.0}, "TORQUE", AMBER),
        ({"engine_power_shp": 3001.0}, "POWER", AMBER),
        ({"control_on_stop": 1.0}, "ON STOP", RED),
        ({"protection_pedal_reason": 16.0}, "PROTECTION", ACTING),
        ({"failures": 4.0}, "FAILURE", RED),
    ],
)
def test_each_lamp_has_its_own_reason(signals: dict[str, float], word: str, colour: object) -> None:
    assert word in lamps.LAMPS
    assert lamps.lit(row_of(**signals)) == {word: colour}


def test_every_word_fits_its_lamp_and_says_who_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []

    def note(_art: LineArt, text: str, *_place: float, height: float, **_style: object) -> None:
        said.append(text)
        assert text_width(text, height) < lamps._WIDE

    monkeypatch.setattr(LineArt, "text", note)
    lamps.draw_faces(LineArt())
    for pilot, nacelle, down in ((0.0, 90.0, 0.0), (1.0, 60.0, 0.0), (2.0, 0.0, 1.0), (math.nan, 0.0, 1.0)):
        lamps.draw(LineArt(), row_of(pilot_mode=pilot, nacelle_deg=nacelle, on_downstop=down))
    assert said[: len(lamps.LAMPS)] == list(lamps.LAMPS)
    assert said[len(lamps.LAMPS) :] == [
        "MOCM", "HELICOPTER", "EXTERNAL", "CONVERSION", "HOLD", "AIRPLANE", "EXTERNAL", "AIRPLANE",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("level", "low", "high", "words"),
    [
        (0.0, 30.0, 60.0, "CORRIDOR CLEAR  +30 kn"),
        (1.0, 8.0, 60.0, "CAUTION  TOO SLOW  +8 kn"),
        (2.0, 60.0, 3.0, "WARNING  TOO FAST  +3 kn"),
        (3.0, 60.0, -5.0, "OUTSIDE  TOO FAST  -5 kn"),
    ],
)
def test_the_band_says_level_side_and_margin_and_grows_louder(
    level: float, low: float, high: float, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(LineArt, "text", lambda _art, text, *_place, **_style: said.append(text))
    art = LineArt()
    row = row_of(corridor_level=level, margin_low_kt=low, margin_high_kt=high, margin_kt=min(low, high))
    instruments._draw_annunciator(art, row)
    assert said == [words]
    assert len(art.strips) == (1 if level else 0), "quiet while clear"
    if level:
        assert art.colours == [LEVELS[int(level)]]
        assert (art.radii[0] > 0.0) == (level > 1.0), "filled from a warning on"


def test_what_never_moves_is_logged_once_and_the_far_goes_along_without_turning() -> None:
    recording = Recording()
    shown = scene.Scene(recording)
    meshes = {path for path, archetype in recording.static if isinstance(archetype, rr.Mesh3D)}
    assert {"world/horizon/sky", "world/horizon/sun/disc", "world/ground/fields", "world/aircraft/cockpit"} <= set(
        meshes
    )
    shown.update(row_of(altitude_m=80.0, heading_deg=20.0))
    recording.logged.clear()
    shown.update(row_of(time_s=0.1, altitude_m=80.0, heading_deg=25.0, north_m=40.0, east_m=-7.0))
    assert not [path for path, archetype in recording.logged if isinstance(archetype, rr.Mesh3D)]
    moved = dict(recording.logged)
    horizon, rose = moved["world/horizon"], moved["world/rose"]
    assert array(horizon.translation)[0] == pytest.approx([40.0, -7.0, 0.0])  # type: ignore[attr-defined]
    assert horizon.quaternion is None  # type: ignore[attr-defined]
    assert array(rose.scale)[0] == pytest.approx([68.0, 68.0, 80.0])  # type: ignore[attr-defined]
    assert "world/ground" not in moved, "the ground moves in steps of its pattern only"


def test_the_ground_moves_by_whole_patterns_along_the_runway() -> None:
    recording = Recording()
    shown = scene.Scene(recording)
    shown.update(row_of(heading_deg=30.0))
    for way in (300.0, 700.0, 1400.0, 1600.0):
        north, east = way * math.cos(math.radians(30.0)), way * math.sin(math.radians(30.0))
        shown.update(row_of(heading_deg=30.0, north_m=north, east_m=east))
    places = [array(one.translation)[0] for path, one in recording.logged if path == "world/ground"]  # type: ignore[attr-defined]
    assert [float(np.hypot(*place[:2])) for place in places] == pytest.approx([0.0, 1000.0, 2000.0], abs=1e-3)
    assert math.degrees(math.atan2(places[-1][1], places[-1][0])) == pytest.approx(30.0, abs=1e-4)


def test_fields_fit_themselves_and_trees_keep_off_the_runway() -> None:
    fields = surroundings.fields()
    coordinates = array(fields.vertex_texcoords)
    assert np.ptp(coordinates, axis=0) == pytest.approx([5.0, 5.0]), "whole squares of the pattern"
    picture = surroundings.field_pattern(96)
    assert picture.shape == (96, 96, 3)
    assert np.array_equal(picture, surroundings.field_pattern(96)), "the same on every machine and day"
    _, places = surroundings.trees()
    where = array(places.translations)
    assert len(where) > 300
    across = np.abs(where[:, 1] - surroundings.PATTERN * np.round(where[:, 1] / surroundings.PATTERN))
    assert across.min() > 60.0


def test_the_sun_stands_where_it_is_said_and_the_hills_reach_above_the_horizon() -> None:
    middle = array(surroundings.sun()["disc"].vertex_positions)[0]
    azimuth, elevation = surroundings.SUN
    assert math.atan2(middle[1], middle[0]) == pytest.approx(azimuth, abs=1e-4)
    assert math.atan2(-middle[2], math.hypot(middle[0], middle[1])) == pytest.approx(elevation, abs=1e-4)
    for number in (0, 1):
        points = array(surroundings.hills(number).vertex_positions)
        height = -points[:, 2].min()
        assert 1.0 < math.degrees(math.atan2(height, math.hypot(*points[0, :2]))) < 6.0


def test_the_pilot_sees_over_the_glare_shield() -> None:
    points = array(cockpit.frame().vertex_positions) - np.array(cockpit.EYE)
    shield = points[:4]
    assert (shield[:, 0] > 0.0).all()
    below = np.degrees(np.arctan2(shield[:, 2], shield[:, 0]))
    assert 12.0 < below.min() < 30.0


def test_a_ghost_can_be_looked_through_and_has_a_place_of_its_own() -> None:
    recording = Recording()
    ghost = Aircraft(recording, "world/ghost", ghost=GHOST)
    ghost.update(row_of(north_m=5.0, nacelle_deg=90.0))
    assert all(path.startswith("world/ghost") for path, _ in recording.static + recording.logged)
    body = dict(recording.static)["world/ghost/body"]
    red, green, blue = GHOST
    packed = red << 24 | green << 16 | blue << 8 | GHOST_OPACITY
    assert array(body.albedo_factor).tolist() == [packed]  # type: ignore[attr-defined]


def test_lines_given_as_arrays_are_the_lines_that_were_drawn() -> None:
    art = LineArt()
    art.line([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]], (1, 2, 3), radius=-1.5)
    art.line([[6.0, 7.0], [8.0, 9.0]], (4, 5, 6, 7), radius=2.0)
    lines = art.archetype(3.0)
    assert lines.strips.as_arrow_array().to_pylist() == [[[0, 1], [2, 3], [4, 5]], [[6, 7], [8, 9]]]
    assert array(lines.colors).tolist() == [0x010203FF, 0x04050607]
    assert array(lines.radii).tolist() == [-1.5, 2.0]
    assert LineArt().archetype(0.0).strips.as_arrow_array().to_pylist() == []


@pytest.mark.parametrize(
    ("source", "end"),
    [
        ("rerun+http://127.0.0.1:9/proxy", ["--expect-data-soon", "--connect", "rerun+http://127.0.0.1:9/proxy"]),
        ("/tmp/flight.rrd", ["/tmp/flight.rrd"]),
    ],
)
def test_the_viewer_is_given_a_flight_or_a_recording(
    source: str, end: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[list[str]] = []
    monkeypatch.setattr(viewer, "_binary", lambda: "rerun")
    monkeypatch.setattr(viewer.subprocess, "run", lambda *_, **__: None)
    monkeypatch.setattr(viewer.subprocess, "Popen", lambda command, **_: started.append(command))
    viewer.Viewer(ViewOptions(), source)
    (command,) = started
    assert command[: command.index("2GiB") + 1] == [
        "rerun", "--bind", "127.0.0.1", "--port", "auto", "--memory-limit", "2GiB",
    ]  # fmt: skip
    assert command[command.index("2GiB") + 1 :] == end
