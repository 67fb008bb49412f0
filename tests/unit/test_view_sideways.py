"""What the view draws of bank, heading, place, wind and the two sides: each looked at in what is logged or drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.view import (
    aircraft,
    airframe,
    gauges,
    ground_map,
    instruments,
    scene,
    surroundings,
    turning,
    undercarriage,
)
from telemetry.view.colours import GREEN, LEFT_ROTOR, RED, RIGHT_ROTOR, TRAIL, WHITE, WIND
from telemetry.view.strokes import Colour, LineArt


def noted_words(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is written from now on."""
    said: list[str] = []

    def note(_art: LineArt, text: str, *_place: float, **_style: object) -> None:
        said.append(text)

    monkeypatch.setattr(LineArt, "text", note)
    return said


NORTH, EAST, DOWN = np.eye(3)


def row_of(**signals: float) -> FloatArray:
    row = np.zeros(SIGNAL_COUNT)
    for name, value in signals.items():
        row[getattr(COLUMN, name)] = value
    return row


def turned(quaternion: list[float], vector: FloatArray) -> FloatArray:
    """A vector turned by a quaternion x y z w."""
    axis, w = np.array(quaternion[:3]), quaternion[3]
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def about(axis: FloatArray, angle_deg: float, vectors: FloatArray) -> FloatArray:
    return np.array([turned(turning.about(axis, math.radians(angle_deg)), vector) for vector in vectors])


class Recording:
    """Notes what is logged."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, object]] = []

    def log(self, path: str, archetype: object, *, static: bool = False) -> None:
        if not static:
            self.logged.append((path, archetype))

    def take(self) -> dict[str, object]:
        taken = dict(self.logged)
        self.logged.clear()
        return taken


def strips_of(art: LineArt, colour: Colour) -> list[FloatArray]:
    return [strip for strip, own in zip(art.strips, art.colours, strict=True) if own == colour]


def test_a_right_bank_lowers_the_right_wing_of_the_drawn_aircraft() -> None:
    attitude = aircraft.attitude_of(row_of(bank_deg=30.0))
    wing = np.array([turned(attitude, vertex) for vertex in airframe.wing().vertices])
    right, left = airframe.wing().vertices[:, 1] > 4.8, airframe.wing().vertices[:, 1] < -4.8
    # z points down: the right tip is lower by the span times the sine of the bank.
    assert wing[right, 2].mean() - wing[left, 2].mean() == pytest.approx(9.8 * math.sin(math.radians(30.0)), rel=0.02)


@pytest.mark.parametrize(
    ("heading", "nose", "right"), [(0.0, NORTH, EAST), (90.0, EAST, -NORTH), (180.0, -NORTH, -EAST)]
)
def test_the_nose_points_where_the_heading_says(heading: float, nose: FloatArray, right: FloatArray) -> None:
    attitude = aircraft.attitude_of(row_of(heading_deg=heading))
    assert turned(attitude, NORTH) == pytest.approx(nose, abs=1e-12)
    assert turned(attitude, EAST) == pytest.approx(right, abs=1e-12)


@given(st.floats(-80, 80), st.floats(-60, 60), st.floats(0, 360))
def test_bank_pitch_and_heading_are_read_back_from_the_drawn_attitude(bank: float, pitch: float, head: float) -> None:
    attitude = aircraft.attitude_of(row_of(bank_deg=bank, pitch_deg=pitch, heading_deg=head))
    nose, right, below = (turned(attitude, axis) for axis in (NORTH, EAST, DOWN))
    assert math.degrees(math.asin(-nose[2])) == pytest.approx(pitch, abs=1e-6)
    assert math.degrees(math.atan2(right[2], below[2])) == pytest.approx(bank, abs=1e-6)
    assert math.cos(math.atan2(nose[1], nose[0]) - math.radians(head)) == pytest.approx(1.0, abs=1e-9)


def test_the_aircraft_is_where_north_east_and_altitude_say() -> None:
    assert aircraft.place_of(row_of(north_m=3.0, east_m=-4.0, altitude_m=50.0, distance_m=99.0)) == [3.0, -4.0, -50.0]


def test_the_compass_rose_and_the_map_have_north_ahead_and_east_to_the_right() -> None:
    strips = [np.array(strip) for strip in surroundings.compass_rose().strips.as_arrow_array().to_pylist()]
    letters = strips[13:]  # after ring and twelve marks
    middle = [np.mean(np.concatenate([strip]), axis=0) for strip in letters]
    assert middle[0] @ NORTH > 1.1  # N first
    assert abs(middle[0] @ EAST) < 0.15
    assert max(place @ EAST for place in middle) > 1.1
    assert ground_map.on_map(1.0, 0.0).tolist() == [0.0, -1.0], "north is up"
    assert ground_map.on_map(0.0, 1.0).tolist() == [1.0, 0.0], "east is right"


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_each_disc_tilts_by_its_own_flapping(side: float) -> None:
    row = row_of(
        longitudinal_flapping_deg=3.0, differential_longitudinal_flapping_deg=1.0, lateral_flapping_deg=2.0,
        differential_lateral_flapping_deg=-0.5,
    )  # fmt: skip
    axis = turned(aircraft.hub_of(row, side), NORTH)
    assert math.degrees(math.asin(axis[2])) == pytest.approx(3.0 + side, abs=0.01), "forward in helicopter mode"
    # Positive sine flapping lifts the outboard edge: the disc leans inboard.
    assert math.degrees(math.asin(axis[1])) == pytest.approx(-side * (2.0 - 0.5 * side), abs=0.01)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_blades_advance_outboard_with_their_leading_edge_first(side: float) -> None:
    # In helicopter mode the mast (+x) is up and +z ahead; the outboard blade of the right rotor is at +y.
    outboard = side * EAST
    moved = turned(turning.about_x(side * 0.01), outboard) - outboard
    assert moved[2] > 0.0
    blade = airframe.blades(side).vertices
    blade = blade[blade @ np.array([0.0, 1.0, 0.0]) > 0.9 * airframe.ROTOR_RADIUS]  # one stands along +y
    chordwise = side * blade[:, 2]  # ahead where the blade moves
    assert chordwise.max() == pytest.approx(0.12, abs=0.01), "the blunt edge, near the blade's axis, is ahead"
    assert chordwise.min() == pytest.approx(-0.30, abs=0.01)


def test_control_surfaces_move_the_right_way() -> None:
    row = row_of(aileron_deg=10.0, rudder_deg=12.0, elevator_deg=8.0, flap_deg=40.0)
    angles = aircraft.surface_angles(row)
    assert angles["flaperon_right"] == pytest.approx(15.0), "droop 25 less 10: right one up"
    assert angles["flaperon_left"] == pytest.approx(35.0)
    assert angles["flap_left"] == angles["flap_right"] == 40.0

    def movement(surface: airframe.Surface, angle: float) -> FloatArray:
        """How far the point farthest aft moves."""
        aft = surface.mesh.vertices[np.argmin(surface.mesh.vertices[:, 0])]
        return about(surface.axis, angle, aft[None])[0] - aft

    assert movement(airframe.elevator(), angles["elevator"])[2] > 0.02, "trailing edge down"
    for side in (1.0, -1.0):
        assert movement(airframe.flaperon(side), 10.0)[2] > 0.02
        assert movement(airframe.rudder(side), angles["rudder_right"])[1] > 0.02, "trailing edge right: nose right"


def test_surfaces_fill_their_cut_outs() -> None:
    def volume(mesh: airframe.Mesh) -> float:
        corners = mesh.vertices[mesh.triangles]
        return float((np.cross(corners[:, 1], corners[:, 2]) * corners[:, 0]).sum() / 6.0)

    parts = [airframe.flap(side) for side in (1.0, -1.0)] + [airframe.flaperon(side) for side in (1.0, -1.0)]
    for part in parts:
        assert volume(part.mesh) > 0.0
    chord, span = 63.0 * 0.0254, 2 * 193.0 * 0.0254
    outline = airframe._airfoil(chord, 0.23, 28)
    area = 0.5 * abs(np.sum(outline[:, 0] * np.roll(outline[:, 2], -1) - np.roll(outline[:, 0], -1) * outline[:, 2]))
    together = volume(airframe.wing()) + sum(volume(part.mesh) for part in parts)
    assert together == pytest.approx(area * span, rel=0.01)


def test_what_does_not_move_sends_nothing_and_a_straight_flight_little() -> None:
    recording = Recording()
    shown, panel = scene.Scene(recording), instruments.Instruments(recording)
    for step in range(3):
        recording.take()
        row = row_of(time_s=0.1 * step, airspeed_kt=90.0, altitude_m=100.0, nacelle_deg=75.0, north_m=4.0 * step)
        shown.update(row)
        panel.update(row)
    paths = list(recording.take())
    assert not [path for path in paths if any(word in path for word in ("flap", "rudder", "elevator", "wind"))]
    assert not [path for path in paths if "tape" in path or "ball" in path]
    assert len(paths) <= 14
    row = row_of(time_s=0.4, heading_deg=20.0, bank_deg=10.0, rudder_deg=3.0, wind_east_m_s=5.0, altitude_m=100.0)
    shown.update(row)
    panel.update(row)
    moved = recording.take()
    assert {"world/wind", "world/aircraft/rudder_left", "instruments/ball", "instruments/heading_tape"} <= set(moved)
    arrow = moved["world/wind"]
    assert arrow.vectors.as_arrow_array().to_pylist()[0] == pytest.approx([0.0, 2.5, 0.0])  # type: ignore[attr-defined]
    shown.update(row_of(time_s=0.5))
    assert isinstance(recording.take()["world/wind"], rr.Clear)


def test_wheels_are_down_to_land_pressed_on_the_ground_and_gone_in_cruise() -> None:
    recording = Recording()
    shown = scene.Scene(recording)
    shown.update(row_of(nacelle_deg=90.0))
    down = {path for path in recording.take() if "leg_" in path}
    assert {f"world/aircraft/leg_{name}/wheels" for name in ("nose", "left", "right")} <= down
    shown.update(row_of(nacelle_deg=88.0, weight_on_wheels=1.0))
    (wheels,) = [archetype for path, archetype in recording.logged if path == "world/aircraft/leg_left/wheels"]
    up = wheels.translation.as_arrow_array().to_pylist()[0]  # type: ignore[attr-defined]
    assert up == pytest.approx([0.0, 0.0, -0.5 * undercarriage.MAIN_STROKE])
    centre = recording.take()["world/aircraft"].translation.as_arrow_array().to_pylist()[0]  # type: ignore[attr-defined]
    assert centre == pytest.approx([0.0, 0.0, -undercarriage.STANDING_HEIGHT])  # the ground is where the wheels stand
    for nacelle, kinds in ((65.0, rr.Transform3D), (10.0, rr.Clear), (70.0, rr.Transform3D)):
        shown.update(row_of(nacelle_deg=nacelle))
        assert isinstance(recording.take()["world/aircraft/leg_nose"], kinds)
        shown.update(row_of(nacelle_deg=nacelle))
        assert "world/aircraft/leg_nose" not in recording.take()


def test_the_runway_lies_along_the_departure_and_the_camera_follows_the_heading() -> None:
    recording = Recording()
    shown = scene.Scene(recording)
    shown.update(row_of(), trail=False)
    assert "world/runway" not in recording.take()
    shown.update(row_of(heading_deg=90.0))
    shown.update(row_of(time_s=1.0, heading_deg=200.0))
    runway = [archetype for path, archetype in recording.logged if path == "world/runway"]
    assert len(runway) == 1
    for archetype, heading in ((runway[0], 90.0), (recording.take()["world/chase"], 200.0)):
        x, y, z, w = archetype.quaternion.as_arrow_array().to_pylist()[0]  # type: ignore[attr-defined]
        nose = turned([x, y, z, w], NORTH)
        assert math.degrees(math.atan2(nose[1], nose[0])) % 360.0 == pytest.approx(heading, abs=1e-3)


@pytest.mark.parametrize("bank", [0.0, 30.0, -60.0])
def test_the_horizon_tilts_against_the_bank_and_the_pointer_with_it(bank: float) -> None:
    recording = Recording()
    panel = instruments.Instruments(recording)
    panel.update(row_of(bank_deg=bank, pitch_deg=10.0))
    ball = recording.take()["instruments/ball"]
    x, y, _ = ball.translation.as_arrow_array().to_pylist()[0]  # type: ignore[attr-defined]
    # Nose up: the horizon is below the symbol, in the aircraft's own sense of below, 32 units away.
    assert (x, y) == pytest.approx((32.0 * math.sin(math.radians(bank)), 32.0 * math.cos(math.radians(bank))), abs=1e-4)
    if bank:
        turn = ball.rotation_axis_angle.as_arrow_array().to_pylist()[0]  # type: ignore[attr-defined]
        assert turn["axis"] == [0.0, 0.0, 1.0]
        assert turn["angle"] == pytest.approx(-math.radians(bank), abs=1e-6)  # y down: the right end of it is higher
    art = LineArt()
    instruments._draw_bank_and_slip(art, row_of(bank_deg=bank))
    tip = art.strips[0][0]
    assert math.degrees(math.atan2(tip[0], -tip[1])) == pytest.approx(-bank)


@pytest.mark.parametrize(("acceleration", "place"), [(0.0, 0.0), (0.05, -10.0), (-0.05, 10.0), (3.0, -26.0)])
def test_the_slip_ball_goes_against_the_specific_force_and_stays_in_its_tube(acceleration: float, place: float) -> None:
    art = LineArt()
    instruments._draw_bank_and_slip(art, row_of(lateral_acceleration=acceleration))
    assert art.strips[-1][:, 0].mean() == pytest.approx(place)


@pytest.mark.parametrize(("rate", "end"), [(0.0, None), (3.0, 45.0), (-3.0, -45.0), (90.0, 75.0)])
def test_the_turn_rate_shows_the_heading_in_six_seconds(rate: float, end: float | None) -> None:
    art = LineArt()
    instruments._draw_course(art, row_of(turn_rate_deg_s=rate))
    bars = strips_of(art, GREEN)
    assert [bar[-1, 0] for bar in bars] == ([] if end is None else [pytest.approx(end)])


@pytest.mark.parametrize(("track", "heading", "x"), [(10.0, 350.0, 50.0), (350.0, 10.0, -50.0), (180.0, 0.0, -75.0)])
def test_the_track_is_marked_beside_the_heading_across_north(track: float, heading: float, x: float) -> None:
    art = LineArt()
    instruments._draw_course(art, row_of(track_deg=track, heading_deg=heading, ground_speed_kt=60.0))
    assert strips_of(art, GREEN)[0][:4].mean(0)[0] == pytest.approx(x)
    still = LineArt()
    instruments._draw_course(still, row_of(track_deg=track, heading_deg=heading, ground_speed_kt=1.0))
    assert not still.strips


def test_the_heading_window_never_says_360(monkeypatch: pytest.MonkeyPatch) -> None:
    said = noted_words(monkeypatch)
    for heading in (0.0, 7.4, 359.4, 359.7):
        instruments._draw_windows(LineArt(), row_of(heading_deg=heading, airspeed_kt=-0.2))
    assert [word for word in said if len(word) == 3 and word.isdigit()] == ["000", "007", "359", "000"]
    assert "-0" not in said


def test_both_sides_have_bars_of_their_own_that_end_at_full_scale() -> None:
    def length(art: LineArt, colour: Colour, number: int) -> float:
        return float(np.ptp(strips_of(art, colour)[number][:, 0]))

    art = LineArt()
    gauges._draw_sides(art, row_of(flapping_left_deg=6.0, flapping_right_deg=3.0, mast_torque_left_inlb=1e9))
    assert length(art, LEFT_ROTOR, 0) == pytest.approx(2.0 * length(art, RIGHT_ROTOR, 0))
    assert length(art, LEFT_ROTOR, 1) == 128.0, "at the end of the scale"
    assert length(art, RIGHT_ROTOR, 1) == 0.0


@pytest.mark.parametrize(("value", "colour"), [(0.5, GREEN), (1.0, RED), (-1.0, RED)])
def test_lateral_stick_and_pedals_are_shown_right_of_their_middle_for_right(value: float, colour: Colour) -> None:
    art = LineArt()
    gauges._draw_controls(art, row_of(lateral_stick=value, pedal=value, lever=0.5))
    bars = [bar for bar in strips_of(art, colour) if bar[0, 0] < 0.0]
    assert len(bars) == 2, "the lateral controls are on the left half"
    for bar in bars:
        assert bar[0, 0] == pytest.approx(-45.0), "from the middle"
        assert bar[-1, 0] - bar[0, 0] == pytest.approx(35.0 * value)


@given(st.lists(st.floats(-1e6, 1e6), min_size=SIGNAL_COUNT, max_size=SIGNAL_COUNT))
def test_nothing_a_row_can_say_leaves_the_instruments(values: list[float]) -> None:
    row, art = np.array(values), LineArt()
    instruments._draw_bank_and_slip(art, row)
    instruments._draw_course(art, row)
    gauges._draw_sides(art, row)
    gauges._draw_controls(art, row)
    points = np.concatenate(art.strips)
    (left, right), (top, bottom) = instruments.BOUNDS
    assert left <= points[:, 0].min()
    assert points[:, 0].max() <= right
    assert top <= points[:, 1].min()
    assert points[:, 1].max() <= bottom


def test_the_map_keeps_the_last_minute_inside_its_ring() -> None:
    recording = Recording()
    shown = ground_map.GroundMap(recording)
    for second in range(61):
        shown.update(row_of(time_s=float(second), north_m=40.0 * second, heading_deg=0.0, ground_speed_kt=78.0))
    assert ground_map.ring_radius(shown._trail, (2400.0, 0.0)) == 5000.0
    assert ground_map.ring_radius([(0.0, 0.0)], (0.0, 0.0)) == 50.0
    art = LineArt()
    ground_map._draw_track(art, [*shown._trail, (2400.0, 0.0)], 5000.0)
    track = strips_of(art, TRAIL)[0]
    assert track[-1].tolist() == [0.0, 0.0]
    assert track[0] == pytest.approx([0.0, 2400.0 / 5000.0 * ground_map.RING]), "what lies behind is south of it"


def test_the_map_turns_the_aircraft_and_says_where_the_wind_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    art = LineArt()
    ground_map._draw_aircraft(art, row_of(heading_deg=90.0, track_deg=90.0, ground_speed_kt=60.0), 500.0)
    body = strips_of(art, WHITE)[-1]
    assert body[0] == pytest.approx([7.0, 0.0], abs=1e-9), "the nose is to the right: east"
    assert strips_of(art, GREEN)[0][-1][0] == pytest.approx(308.67 / 500.0 * ground_map.RING, rel=1e-3)
    said = noted_words(monkeypatch)
    wind = LineArt()
    ground_map._draw_wind(wind, row_of(wind_east_m_s=-7.7167))
    ground_map._draw_wind(LineArt(), row_of())
    assert said == ["090/15 kn"]
    shaft = strips_of(wind, WIND)[0]
    assert shaft[-1][0] < shaft[0][0], "an east wind blows to the left"
