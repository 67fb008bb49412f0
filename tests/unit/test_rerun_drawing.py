"""Meshes, line art and layouts of the view, without a viewer."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from rtsim.frame import COLUMN, SIGNAL_COUNT, SIGNAL_NAMES
from telemetry.log.format import LOG_NAMES, LOG_SIGNALS
from telemetry.log.signal_groups import FLAGS, label, plot_groups
from telemetry.view import airframe, undercarriage
from telemetry.view import corridor as rerun_corridor
from telemetry.view.blueprint import blueprint
from telemetry.view.options import Layout
from telemetry.view.overlay import COMPARED
from telemetry.view.plots import ACTING_NAMES, PILOT_PLOTS, acting_on
from telemetry.view.strokes import LineArt, text_width

PARTS = {
    "fuselage": airframe.fuselage(),
    "wing": airframe.wing(),
    "tail": airframe.tail(),
    "nacelle": airframe.nacelle(),
    "blades": airframe.blades(1.0),
    "fairing": undercarriage.fairing(-1.0),
    **{f"{name} strut": leg.strut for name, leg in undercarriage.legs().items()},
    **{f"{name} wheels": leg.wheels for name, leg in undercarriage.legs().items()},
}


def plot_path(signal_name):
    """The plot that shows a signal."""
    return next(group.path for group in plot_groups() if LOG_NAMES.index(signal_name) in group.columns)


@pytest.mark.parametrize("name", PARTS)
def test_meshes_are_closed_and_face_outwards(name: str) -> None:
    mesh = PARTS[name]
    assert mesh.triangles.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    assert np.isfinite(mesh.normals).all()
    corners = mesh.vertices[mesh.triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # Over a closed surface the area vectors add up to nothing, and its volume is positive if they point outwards.
    assert np.abs(faces.sum(0)).max() < 1e-6 * np.abs(faces).sum()
    assert (faces * corners[:, 0]).sum() > 0.0


def test_the_aircraft_has_the_size_of_an_xv15() -> None:
    fuselage, wing = PARTS["fuselage"].vertices, PARTS["wing"].vertices
    assert np.ptp(fuselage[:, 0]) == pytest.approx(13.2, abs=0.3)
    assert np.ptp(wing[:, 1]) == pytest.approx(32.17 * 0.3048, abs=0.01)
    assert np.linalg.norm(PARTS["blades"].vertices, axis=1).max() == pytest.approx(3.81, abs=0.05)
    assert np.linalg.norm(airframe.circle(12), axis=1) == pytest.approx(3.81)


def test_left_and_right_are_mirror_images() -> None:
    for name in ("fuselage", "wing", "tail"):
        vertices = PARTS[name].vertices
        mirrored = vertices * [1.0, -1.0, 1.0]
        order = np.lexsort(np.round(vertices, 6).T)
        other = np.lexsort(np.round(mirrored, 6).T)
        assert np.allclose(vertices[order], mirrored[other], atol=1e-5), name


def test_every_signal_is_plotted_once_or_is_a_state() -> None:
    columns = [column for group in plot_groups() for column in group.columns]
    assert len(columns) == len(set(columns))
    assert {LOG_NAMES[column] for column in columns} | FLAGS == set(LOG_NAMES)
    assert len({group.path for group in plot_groups()}) == len(plot_groups())
    assert {"airspeed_kt", "work_us"} <= {LOG_NAMES[column] for column in columns}


def test_every_character_the_instruments_write_is_drawn() -> None:
    for character in "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ+-./%:\N{DEGREE SIGN}()=":
        art = LineArt()
        art.text(character, 0.0, 0.0, height=6.0, colour=(255, 255, 255))
        points = np.concatenate(art.strips)
        assert points[:, 0].min() >= 0.0
        assert points[:, 0].max() <= 4.0
        assert np.abs(points[:, 1]).max() <= 3.0


@pytest.mark.parametrize(("align", "left"), [("left", 0.0), ("centre", -0.5), ("right", -1.0)])
def test_text_is_aligned(align: str, left: float) -> None:
    art = LineArt()
    art.text("HH", 10.0, 0.0, height=6.0, colour=(255, 255, 255), align=align)  # type: ignore[arg-type]
    points = np.concatenate(art.strips)
    width = text_width("HH", 6.0)
    assert np.ptp(points[:, 0]) == pytest.approx(width)
    assert points[:, 0].min() == pytest.approx(10.0 + left * width)


@pytest.mark.parametrize("replay", [False, True])
@pytest.mark.parametrize("layout", ["pilot", "cockpit", "engineer", "compare"])
def test_layouts_name_only_entities_that_are_logged(layout: Layout, replay: bool) -> None:
    views = list(_views(blueprint(layout, replay=replay).root_container))
    origins = {str(view.origin).strip("/") for view in views}
    known = {"world/chase", "world/aircraft", "instruments", "corridor", "map", "events", "events/log"} | {
        group.path for group in plot_groups()
    }
    known |= set(PILOT_PLOTS)
    if layout == "compare":
        known |= {f"{kind}/{name}" for kind in ("compare", "difference") for name in COMPARED} | {"difference/apart"}
    assert origins <= known
    assert {"world/chase", "world/aircraft", "corridor", "map", "events", "events/log"} <= origins
    if layout == "engineer":
        assert {group.path for group in plot_groups()} <= origins, "the engineer sees every signal"


def test_a_plot_says_its_unit_once() -> None:
    titles = {group.path: group.title for group in plot_groups()}
    assert titles[plot_path("mast_torque_inlb")] == "Mast torque [in lb]"
    assert titles[plot_path("stick")] == "Sticks, lever and pedals [-]"
    assert plot_path("protection_stick") != plot_path("protection_stick_reason"), "a number of a limit is no share"
    for signal in LOG_SIGNALS:
        if signal.unit and signal.name not in FLAGS:
            shown = label(signal.name, unit=False)
            assert shown != label(signal.name), f"{signal.name} would show its unit twice"
            assert shown.split(), signal.name
    assert label("airspeed_kt", unit=False) == "airspeed"


def test_the_view_says_on_what_protection_acts() -> None:
    row = np.zeros(SIGNAL_COUNT)
    assert ACTING_NAMES[acting_on(row)] == "NOT ACTING"
    row[COLUMN.protection_lever_reason] = 7.0
    assert ACTING_NAMES[acting_on(row)] == "ON LEVER"
    row[COLUMN.protection_nacelle_reason] = 1.0
    assert ACTING_NAMES[acting_on(row)] == "ON LEVER, NACELLES"
    row[COLUMN.protection_pedal_reason] = 1.0
    assert ACTING_NAMES[acting_on(row)] == "ON LEVER, NACELLES, PEDALS"
    assert len(set(ACTING_NAMES)) == 32


def _views(part: object) -> list[object]:
    contents = getattr(part, "contents", None)
    if isinstance(contents, (list, tuple)) and not hasattr(part, "class_identifier"):
        return [view for child in contents for view in _views(child)]
    return [part]


def test_the_corridor_point_stays_inside_the_picture_and_level_is_bounded() -> None:
    recording = rr.RecordingStream("rtsim-test")
    sink = recording.memory_recording()
    plot = rerun_corridor.CorridorPlot(recording, None)
    row = np.zeros(SIGNAL_COUNT)
    for speed, level in ((-300.0, 0.0), (500.0, 3.0), (100.0, np.nan)):
        row[COLUMN.airspeed_kt], row[COLUMN.corridor_level] = speed, level
        row[COLUMN.time_s] += 1.0
        plot.update(row)
        assert 0 <= rerun_corridor.level_of(row) <= 3
    assert len(plot._trail) == 3
    assert all(-40.0 <= point[0] <= 200.0 for point in plot._trail)
    assert sink is not None
    assert "corridor_level" in SIGNAL_NAMES
