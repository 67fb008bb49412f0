"""FlightGear's packet: its layout and every number in it, read back by pymavlink's own parser."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.fgFDM import fgFDM

from rtsim.errors import InputError
from rtsim.frame import COLUMN, SIGNAL_COUNT
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import METRES_PER_DEGREE, HomePosition
from telemetry.flightgear.config import DEFAULT_TARGET, KEFLAVIK, WindowConfig
from telemetry.flightgear.packet import LAYOUT, SIZE, encode
from telemetry.flightgear.sender_process import datagram
from telemetry.view.undercarriage import STANDING_HEIGHT

FLOAT = 1e-6
"""Single precision."""
NUMBERS = {
    "bank_deg": (-180.0, 180.0),
    "pitch_deg": (-80.0, 80.0),
    "heading_deg": (0.0, 360.0),
    "roll_rate_deg_s": (-90.0, 90.0),
    "pitch_rate_deg_s": (-90.0, 90.0),
    "yaw_rate_deg_s": (-90.0, 90.0),
    "north_m": (-50_000.0, 50_000.0),
    "east_m": (-50_000.0, 50_000.0),
    "altitude_m": (-5.0, 3000.0),
    "airspeed_kt": (-40.0, 300.0),
    "ground_speed_kt": (-40.0, 300.0),
    "track_deg": (0.0, 360.0),
    "climb_rate_m_s": (-20.0, 20.0),
    "angle_of_attack_deg": (-90.0, 90.0),
    "sideslip_deg": (-90.0, 90.0),
    "load_factor": (0.2, 3.0),
    "lateral_acceleration": (-0.5, 0.5),
    "nacelle_deg": (0.0, 95.0),
    "flap_deg": (0.0, 75.0),
    "elevator_deg": (-20.0, 20.0),
    "aileron_deg": (-20.0, 20.0),
    "rudder_deg": (-20.0, 20.0),
    "rotor_speed_rpm": (0.0, 650.0),
    "fuel_lb": (0.0, 1490.0),
    "fuel_flow_lb_h": (0.0, 2000.0),
    "weight_on_wheels": (0.0, 3.0),
}
"""Range of every column that the packet tells of."""
STATES = st.fixed_dictionaries({name: st.floats(*limits) for name, limits in NUMBERS.items()})


def row_of(values: dict[str, float]) -> np.ndarray:
    row = np.zeros(SIGNAL_COUNT)
    for name, value in values.items():
        row[getattr(COLUMN, name)] = value
    return row


def parsed(values: dict[str, float], home: HomePosition = KEFLAVIK) -> fgFDM:
    packet = datagram(row_of(values), home)
    assert packet is not None
    oracle = fgFDM()
    oracle.parse(packet)
    return oracle


def test_every_field_stands_where_the_parser_looks_for_it() -> None:
    oracle = fgFDM()
    assert oracle.packet_size() == SIZE == 408
    ours, place = {}, 0
    for field in LAYOUT:
        ours[field.name] = (place, field.size)
        place += field.size
    assert ours == {name: (one.index, one.arraylength) for name, one in oracle.mapping.vars.items()}
    for number, field in enumerate(LAYOUT[1:], 1):
        value = number if field.size == 1 else tuple(range(number, number + field.size))
        oracle.parse(encode({field.name: value}))
        assert oracle.values[0] == 24
        assert [place for place, found in enumerate(oracle.values) if found][1:] == list(
            range(ours[field.name][0], ours[field.name][0] + field.size)
        )


@given(STATES)
def test_the_parser_reads_the_motion_of_the_row(values: dict[str, float]) -> None:
    oracle = parsed(values)
    for field, name in (("phi", "bank"), ("theta", "pitch"), ("psi", "heading")):
        assert oracle.get(field, units="degrees") == pytest.approx(values[f"{name}_deg"], rel=FLOAT, abs=1e-5)
    for field, name in (("alpha", "angle_of_attack"), ("beta", "sideslip")):
        assert oracle.get(field, units="degrees") == pytest.approx(values[f"{name}_deg"], rel=FLOAT, abs=1e-5)
    assert oracle.get("latitude", units="degrees") == pytest.approx(
        KEFLAVIK.latitude_deg + values["north_m"] / METRES_PER_DEGREE, rel=1e-14
    )
    metres_east = METRES_PER_DEGREE * math.cos(math.radians(KEFLAVIK.latitude_deg))
    east = (oracle.get("longitude", units="degrees") - KEFLAVIK.longitude_deg) * metres_east
    assert east == pytest.approx(values["east_m"], abs=1e-6)
    assert oracle.get("altitude") == pytest.approx(45.0 + STANDING_HEIGHT + values["altitude_m"], rel=1e-14)
    assert oracle.get("climb_rate", units="mps") == pytest.approx(values["climb_rate_m_s"], rel=FLOAT, abs=1e-6)
    assert oracle.get("vcas") == pytest.approx(abs(values["airspeed_kt"]), rel=FLOAT)
    assert oracle.get("A_Z_pilot", units="mpss") == pytest.approx(-9.80665 * values["load_factor"], rel=FLOAT)
    assert oracle.get("A_Y_pilot", units="mpss") == pytest.approx(
        9.80665 * values["lateral_acceleration"], rel=FLOAT, abs=1e-6
    )
    # The ball goes to the side from which nothing pushes.
    assert oracle.get("slip_deg") * values["lateral_acceleration"] <= 0.0


@given(STATES)
def test_rates_are_those_of_the_angles(values: dict[str, float]) -> None:
    oracle = parsed(values)
    bank, pitch = math.radians(values["bank_deg"]), math.radians(values["pitch_deg"])
    banking, pitching, turning = (oracle.get(name, units="dps") for name in ("phidot", "thetadot", "psidot"))
    body = (
        banking - turning * math.sin(pitch),
        pitching * math.cos(bank) + turning * math.cos(pitch) * math.sin(bank),
        turning * math.cos(pitch) * math.cos(bank) - pitching * math.sin(bank),
    )
    for found, axis in zip(body, ("roll", "pitch", "yaw"), strict=True):
        assert found == pytest.approx(values[f"{axis}_rate_deg_s"], abs=1e-3)


@given(STATES)
def test_velocities_agree_in_both_axes(values: dict[str, float]) -> None:
    oracle = parsed(values)
    north, east, down = (oracle.get(name, units="mps") for name in ("v_north", "v_east", "v_down"))
    speed = abs(values["ground_speed_kt"]) * 1852.0 / 3600.0
    assert math.hypot(north, east) == pytest.approx(speed, rel=1e-5, abs=1e-5)
    if speed > 1.0:
        turned = math.degrees(math.atan2(east, north)) - values["track_deg"]
        assert (turned + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-3)
    assert down == pytest.approx(-values["climb_rate_m_s"], rel=FLOAT, abs=1e-6)
    angles = (math.radians(values[f"{name}_deg"]) for name in ("bank", "pitch", "heading"))
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in angles)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    body = [oracle.get(f"v_wind_body_{axis}", units="mps") for axis in ("north", "east", "down")]
    assert about_z @ about_y @ about_x @ body == pytest.approx([north, east, down], abs=1e-4)


@given(STATES)
def test_the_parser_reads_what_moves_on_the_aircraft(values: dict[str, float]) -> None:
    oracle = parsed(values)
    assert oracle.get("speedbrake") * 90.0 == pytest.approx(values["nacelle_deg"], rel=FLOAT)
    for side in ("left", "right"):
        assert oracle.get(f"{side}_flap") * 75.0 == pytest.approx(values["flap_deg"], rel=FLOAT)
    assert oracle.get("elevator") * 20.0 == pytest.approx(values["elevator_deg"], rel=FLOAT, abs=1e-9)
    assert oracle.get("rudder") * 20.0 == pytest.approx(values["rudder_deg"], rel=FLOAT, abs=1e-9)
    # The aileron counts the right one up; the packet counts each one down.
    assert oracle.get("left_aileron") * 20.0 == pytest.approx(values["aileron_deg"], rel=FLOAT, abs=1e-9)
    assert oracle.get("right_aileron") == -oracle.get("left_aileron")
    assert oracle.get("num_engines") == 2
    for rotor in range(2):
        assert oracle.get("rpm", rotor) == pytest.approx(values["rotor_speed_rpm"], rel=FLOAT)
        assert oracle.get("eng_state", rotor) == (2 if values["fuel_flow_lb_h"] > 0.0 else 0)
        assert oracle.get("fuel_flow", rotor) * 2.0 * 6.7 == pytest.approx(values["fuel_flow_lb_h"], rel=FLOAT)
    assert oracle.get("fuel_quantity") * 6.7 == pytest.approx(values["fuel_lb"], rel=FLOAT)
    assert oracle.get("num_wheels") == 3
    for wheel in range(3):
        assert oracle.get("wow", wheel) == (values["weight_on_wheels"] > 0.0)
        assert 0.0 <= oracle.get("gear_compression", wheel) <= 1.0
        if not 60.0 < values["nacelle_deg"] < 75.0:
            assert oracle.get("gear_pos", wheel) == (values["nacelle_deg"] >= 75.0)


def test_a_turn_to_the_right_looks_like_one() -> None:
    oracle = parsed({"bank_deg": 20.0, "heading_deg": 359.99, "yaw_rate_deg_s": -3.0, "aileron_deg": 5.0})
    assert oracle.get("phi") > 0.0
    assert oracle.get("psi", units="degrees") == pytest.approx(359.99, abs=1e-4)
    assert oracle.get("psidot") < 0.0
    assert oracle.get("right_aileron") < 0.0 < oracle.get("left_aileron")


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e39])
def test_what_is_no_number_is_not_sent(value: float) -> None:
    assert datagram(row_of({"pitch_rate_deg_s": value}), KEFLAVIK) is None
    assert datagram(row_of({"north_m": value}), KEFLAVIK) is None


def test_fields_are_taken_by_their_names() -> None:
    with pytest.raises(KeyError, match="nacelle"):
        encode({"nacelle": 1.0})
    with pytest.raises(struct.error, match="rpm has 4"):
        encode({"rpm": (1.0, 2.0)})


def test_a_place_may_lie_beyond_the_date_line() -> None:
    latitude, longitude = HomePosition(latitude_deg=0.0, longitude_deg=179.999).place(0.0, 1000.0)
    assert latitude == 0.0
    assert longitude == pytest.approx(-180.0 + 1000.0 / METRES_PER_DEGREE - 0.001)


def test_places_and_addresses_of_a_user() -> None:
    assert HomePosition.parse("63.5,-22.5") == HomePosition(63.5, -22.5, 0.0)
    assert HomePosition.parse("-33.9, 151.2, 6") == HomePosition(-33.9, 151.2, 6.0)
    for wrong in ("", "63", "north,south", "91,0", "0,181", "0,0,1e5", "1,2,3,4", "nan,0"):
        with pytest.raises(InputError, match="--origin"):
            HomePosition.parse(wrong)
    assert Endpoint.parse("127.0.0.1", key="--flightgear", default=DEFAULT_TARGET) == WindowConfig().target
    with pytest.raises(InputError, match=r"--flightgear.*127\.0\.0\.1:5510"):
        Endpoint.parse("127.0.0.1:x", key="--flightgear", default=DEFAULT_TARGET)


def test_settings_survive_the_way_to_the_process() -> None:
    config = WindowConfig(target=Endpoint("127.0.0.2", 5555), home=HomePosition(1.0, 2.0, 3.0, 4.0))
    assert WindowConfig.from_json(config.to_json()) == config
