"""Shared memory, framing, signing, settings and parameters of the MAVLink vehicle."""

from __future__ import annotations

import math
import subprocess
import sys
import time
import tomllib
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from rtsim.command import StickInput
from rtsim.errors import InputError
from rtsim.processes import safe_environment
from telemetry.exchange.endpoint import Endpoint
from telemetry.exchange.globe import HomePosition
from telemetry.exchange.ring import Ring
from telemetry.mavlink.config import MavlinkConfig, Ratings, endpoints, read_signing_key
from telemetry.mavlink.exchange import STOP, Exchange, Feedback, Request
from telemetry.mavlink.framing import frames, signature_time
from telemetry.mavlink.notices import FLAP_SPEEDS
from telemetry.mavlink.parameters import AID_PARAMETERS, PARAMETERS, ParameterStore
from telemetry.mavlink.peers import TokenBucket
from telemetry.mavlink.pilot_input import StickReader
from telemetry.mavlink.signatures import SignatureCheck
from telemetry.mavlink.streams import StreamSchedule

KEY = bytes(range(32))


@pytest.fixture(name="pair")
def _pair():
    first = Exchange()
    second = Exchange(first.descriptor)
    yield first, second
    second.close()
    first.close()


def test_sticks_feedback_requests_and_texts_travel_whole(pair):
    flight, vehicle = pair
    sticks = StickInput(7, 10**15 + 1, 0.5, 0.25, -0.1, 0.2, True, False, -1, 1.5, 1, 0xFFFFFFFF, 65535)
    vehicle.write_sticks(sticks)
    assert flight.read_sticks() == sticks
    feedback = Feedback(*[float(number) for number in range(len(Feedback._fields))])
    flight.write_feedback(feedback)
    assert vehicle.read_feedback() == feedback
    asked = [Request("aid", "attitude_retention", 2.0), Request("parameter", "XV_MC_BLEND_T_16", -0.5)]
    assert all(vehicle.put_request(request) for request in asked)
    assert flight.take_requests() == asked
    assert flight.take_requests() == []
    assert flight.put_text(4, "umlaut ä and " + "x" * 100)
    ((severity, text),) = vehicle.take_texts()
    assert severity == 4
    assert text == ("umlaut ? and " + "x" * 100)[:50]


def test_nan_angle_travels(pair):
    pair[1].write_sticks(StickInput(sequence=1))
    assert math.isnan(pair[0].read_sticks().nacelle_angle)


def test_a_full_queue_refuses_and_goes_on(pair):
    flight, vehicle = pair
    taken = sum(vehicle.put_request(Request("aid", "x", float(number))) for number in range(300))
    assert taken == 256
    assert [request.value for request in flight.take_requests()] == [float(number) for number in range(256)]
    assert vehicle.put_request(Request("reset"))
    assert flight.take_requests() == [Request("reset")]


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
    st.lists(st.booleans(), min_size=4, max_size=4),
    st.lists(st.integers(-1, 1), min_size=3, max_size=3),
    st.integers(0, 31),
)
def test_sticks_pass_whole(values, held, switches, overridden):
    exchange = Exchange()
    stick, lever, lateral, yaw = values
    sticks = StickInput(
        sequence=3, received_ns=7, stick=stick, lever=lever, lateral=lateral, yaw=yaw, stick_valid=held[0],
        lever_valid=held[1], lateral_valid=held[2], yaw_valid=held[3], nacelle_switch=switches[0], nacelle_angle=0.5,
        trim=switches[1], lateral_trim=switches[2], buttons=1 << 31, owner=65535, stream=9, overridden=overridden,
    )  # fmt: skip
    exchange.write_sticks(sticks)
    assert exchange.read_sticks() == sticks
    exchange.close()


WRITER = """
import sys
from rtsim.command import StickInput
from telemetry.mavlink.exchange import STOP, Exchange
exchange, number = Exchange(int(sys.argv[1])), 0
while not exchange.header[STOP]:
    number += 1
    value = (number % 1000) / 1000.0
    exchange.write_sticks(StickInput(sequence=number, stick=value, lever=value, lateral=value, yaw=value))
exchange.close()
"""


def test_a_reader_never_sees_a_torn_value(pair):
    flight = pair[0]
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(flight.descriptor)],
        env=safe_environment(),
        pass_fds=[flight.descriptor],
    )
    seen = set()
    end = time.monotonic() + 120.0  # less than a second where two cores are free
    while len(seen) < 5000 and time.monotonic() < end:
        sticks = flight.read_sticks()
        if sticks is not None:
            assert sticks.stick == sticks.lever == sticks.lateral == sticks.yaw
            seen.add(sticks.sequence)
    flight.header[STOP] = 1
    assert writer.wait(10.0) == 0
    assert len(seen) >= 5000


def test_attaching_to_nothing_or_something_else_is_refused():
    with pytest.raises(InputError, match="no such exchange"):
        Exchange(-1)
    ring = Ring(8)
    with pytest.raises(InputError, match="no exchange of this version"):
        Exchange(ring.descriptor)
    ring.close()


def packed(message, *, system=255, key=None, link=0, stamp=None):
    encoder = dialect.MAVLink(None, srcSystem=system, srcComponent=190)
    if key is not None:
        encoder.signing.secret_key, encoder.signing.link_id, encoder.signing.sign_outgoing = key, link, True
        encoder.signing.timestamp = signature_time() if stamp is None else stamp
    return message.pack(encoder)


BEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def test_frames_of_a_datagram_are_found_between_garbage():
    first = packed(BEAT)
    second = packed(dialect.MAVLink_manual_control_message(1, 1, 2, 3, 4, 5))
    old = BEAT.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=1), force_mavlink1=True)
    found = list(frames(first + b"\xfd\x00junk" + second + b"\xfe" + old + first[:15]))
    assert [frame.message_id for frame in found] == [0, 69, 0]
    assert [frame.raw for frame in found] == [first, second, old]
    assert [frame.component_id for frame in found] == [190, 190, 1]


@pytest.mark.parametrize("place", [1, 2, 4, 5, 7, 10, -1])
def test_a_changed_byte_is_noticed(place):
    data = bytearray(packed(BEAT))
    data[place] ^= 0x55
    assert list(frames(bytes(data))) == []


def test_unknown_flags_and_unknown_messages_are_discarded():
    data = bytearray(packed(BEAT))
    data[2] = 0x02
    assert list(frames(bytes(data))) == []


def test_work_per_datagram_is_bounded():
    assert len(list(frames(packed(BEAT) * 200))) <= 128
    assert list(frames(b"\xfd" * 2048)) == []


@given(st.binary(max_size=600))
def test_no_bytes_raise_and_none_makes_more_frames_than_it_can_hold(data):
    assert len(list(frames(data))) <= len(data) // 8  # the shortest frame of MAVLink 1


def one(data):
    (frame,) = frames(data)
    return frame


def test_signatures_are_checked():
    check = SignatureCheck(KEY)
    assert not check.accepts(one(packed(BEAT)))
    now = signature_time()
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now)))
    assert not check.accepts(one(packed(BEAT, key=KEY, stamp=now)))  # played again
    assert not check.accepts(one(packed(BEAT, key=KEY, stamp=now - 1)))
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now + 1)))
    assert not check.accepts(one(packed(BEAT, key=bytes(32), stamp=now + 2)))
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now + 2)))  # a wrong key does not move the stream's time
    assert not check.accepts(one(packed(BEAT, key=KEY, link=3, stamp=now - 61 * 100_000)))
    assert check.accepts(one(packed(BEAT, key=KEY, link=3, stamp=now - 59 * 100_000)))
    radio = dialect.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    assert check.accepts(one(packed(radio)))
    old = BEAT.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=1), force_mavlink1=True)
    assert not check.accepts(one(old))


def test_signed_frames_are_not_accepted_again_after_a_restart(tmp_path):
    """However the vehicle ended; and the station goes on within a second."""
    kept = tmp_path / "key.seen"
    first = SignatureCheck(KEY, kept)
    now = signature_time()
    seen = [one(packed(BEAT, key=KEY, stamp=now + number)) for number in range(5)]
    assert all(first.accepts(frame) for frame in seen)
    for number in (1, 2):
        again = SignatureCheck(KEY, kept)
        assert not any(again.accepts(frame) for frame in seen)
        seen.append(one(packed(BEAT, key=KEY, stamp=now + number * 100_001)))
        assert again.accepts(seen[-1])


def test_flights_side_by_side_never_lower_a_stamp(tmp_path):
    """Whichever started first, wrote last or heard another station, a third flight refuses what either heard."""
    kept = tmp_path / "key.seen"
    now = signature_time()
    first = SignatureCheck(KEY, kept)
    assert first.accepts(one(packed(BEAT, key=KEY, stamp=now - 30 * 100_000)))
    second = SignatureCheck(KEY, kept)
    heard = [one(packed(BEAT, key=KEY, stamp=now)), one(packed(BEAT, key=KEY, link=2, stamp=now))]
    assert first.accepts(heard[0])
    assert second.accepts(heard[1])
    assert second.accepts(one(packed(BEAT, key=KEY, stamp=now - 20 * 100_000)))  # its own stamp is older
    assert first.accepts(one(packed(BEAT, key=KEY, link=3, stamp=now)))
    third = SignatureCheck(KEY, kept)
    assert not any(third.accepts(frame) for frame in heard)
    assert not third.trouble


def test_a_known_stream_has_no_older_frames_either(monkeypatch):
    check = SignatureCheck(KEY)
    now = signature_time()
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now)))
    monkeypatch.setattr("telemetry.mavlink.signatures.signature_time", lambda: now + 90 * 100_000)
    assert not check.accepts(one(packed(BEAT, key=KEY, stamp=now + 29 * 100_000)))
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now + 31 * 100_000)))


@pytest.mark.parametrize("damage", ["unreadable", "folder", "unwritable"])
def test_where_stamps_cannot_be_kept_only_those_since_the_start_count(tmp_path, damage):
    kept = tmp_path / "key.seen"
    if damage == "unreadable":
        kept.write_text("\x00[1, 2")
    elif damage == "folder":
        kept.mkdir()
    else:
        kept = tmp_path / "nowhere" / "key.seen"
    old = one(packed(BEAT, key=KEY, stamp=signature_time() - 1000))
    check = SignatureCheck(KEY, kept)
    assert check.trouble
    assert not check.accepts(old)
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=signature_time() + 1000)))


def test_a_frame_dated_ahead_is_refused_and_locks_nobody_out():
    check = SignatureCheck(KEY)
    now = signature_time()
    assert not check.accepts(one(packed(BEAT, key=KEY, stamp=now + 3600 * 100_000)))
    assert check.accepts(one(packed(BEAT, key=KEY, stamp=now + 50 * 100_000)))
    assert check.accepts(one(packed(BEAT, key=KEY, link=3, stamp=now - 50 * 100_000)))
    assert check.accepts(one(packed(BEAT, key=KEY, link=4, stamp=now)))


def test_many_streams_lock_nobody_out(monkeypatch):
    from telemetry.mavlink import signatures

    check = SignatureCheck(KEY)
    now = signature_time()
    monkeypatch.setattr(signatures, "_MOST_STREAMS", 8)
    assert all(check.accepts(one(packed(BEAT, key=KEY, link=link, stamp=now))) for link in range(20))
    monkeypatch.setattr(signatures, "signature_time", lambda: now + 61 * 100_000)
    assert check.accepts(one(packed(BEAT, key=KEY, link=99, stamp=now + 61 * 100_000)))
    assert not check.accepts(one(packed(BEAT, key=KEY, link=5, stamp=now)))


def test_signing_keys_are_read_from_private_files(tmp_path):
    file = tmp_path / "key"
    file.write_text(KEY.hex() + "\n")
    with pytest.raises(InputError, match="chmod 600"):
        read_signing_key(file)
    file.chmod(0o600)
    assert read_signing_key(file) == KEY
    file.write_bytes(KEY)
    assert read_signing_key(file) == KEY
    file.write_text("too short")
    with pytest.raises(InputError, match="64 hexadecimal"):
        read_signing_key(file)
    with pytest.raises(InputError, match="does not exist"):
        read_signing_key(tmp_path / "none")


def test_addresses():
    assert Endpoint.parse("127.0.0.1:14551") == Endpoint("127.0.0.1", 14551)
    assert Endpoint.parse("localhost") == Endpoint("127.0.0.1", 14550)
    for wrong in ("", "127.0.0.1:0", "127.0.0.1:70000", ":14550", "127.0.0.1:x", "no such host:1"):
        with pytest.raises(InputError, match="--mavlink"):
            Endpoint.parse(wrong)


def test_leaving_this_machine_needs_permission():
    targets, host, port, warning = endpoints([], allow_network=False)
    assert (targets, host, port, warning) == ((Endpoint("127.0.0.1", 14550),), "127.0.0.1", 0, None)
    for options in ({"targets": ["192.0.2.1:14550"]}, {"targets": [], "bind": "0.0.0.0:14560"}):
        with pytest.raises(InputError, match="--mavlink-network"):
            endpoints(**options, allow_network=False)
        *_, host, _, warning = endpoints(**options, allow_network=True)
        assert host == "0.0.0.0"
        assert "anyone" in warning


def test_settings_survive_the_way_to_the_process():
    config = MavlinkConfig(
        targets=(Endpoint("127.0.0.1", 1), Endpoint("127.0.0.1", 2)),
        aids={"rate_damping": True},
        parameters={"XV_NAC_RATE": 2.0},
        axes={"stick": "-r"},
        buttons={"pilot": 3},
        home=HomePosition(heading_deg=12.0),
        ratings=Ratings(rotor_speed_rpm=700.0),
        whitelist=(255,),
    )
    assert MavlinkConfig.from_json(config.to_json()) == config


def test_parameters_are_declared_well():
    names = [parameter.name for parameter in PARAMETERS] + [name for name, _ in AID_PARAMETERS.values()]
    assert len(set(names)) == len(names)
    assert max(map(len, names)) <= 16
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.default <= parameter.high
        assert parameter.description.endswith(".")


def test_no_flight_begins_without_governor_or_flaps_because_of_a_file(tmp_path):
    on = {"automatic_flaps": True, "governor": True, "rate_damping": True}
    store = ParameterStore(on, {})
    for name in ("XV_AUTO_FLAP", "XV_GOVERNOR", "XV_SAS"):
        store.set(name, 0.0)
    store.save(tmp_path / "a.toml")
    text = (tmp_path / "a.toml").read_text(encoding="utf-8")
    assert "XV_SAS" in text
    assert "XV_GOVERNOR" not in text
    assert "XV_AUTO_FLAP" not in text
    (tmp_path / "a.toml").write_text(text + "XV_GOVERNOR = 0.0\n", encoding="utf-8")
    again = ParameterStore(on, {})
    again.load(tmp_path / "a.toml")
    assert (again["XV_GOVERNOR"], again["XV_SAS"]) == (1.0, 0.0)


def test_flap_speed_limits_are_those_of_the_aircrafts_data():
    """Telemetry reads no aircraft data; its table must say the same (NASA TM X-62407, TM 81244)."""
    file = resources.files("rtsim.aircraft.xv15").joinpath("data", "xv15_inputs.toml")
    data = tomllib.loads(file.read_text(encoding="utf-8"))["controls"]
    assert list(FLAP_SPEEDS) == list(zip(data["flap_settings_deg"], data["flap_speed_limits_kt"], strict=True))


def test_wrong_start_values_are_refused():
    with pytest.raises(InputError, match=r"XV_NAC_RATE.*0\.5 to 7\.5"):
        ParameterStore({}, {"XV_NAC_RATE": 100.0})
    with pytest.raises(InputError, match="XV_NONE"):
        ParameterStore({}, {"XV_NONE": 1.0})


def test_wrong_maps_are_refused():
    with pytest.raises(InputError, match=r"axes\.stick"):
        StickReader({"stick": "w"}, {})
    with pytest.raises(InputError, match=r"axes\.rudder"):
        StickReader({"rudder": "x"}, {})
    with pytest.raises(InputError, match=r"buttons\.fire"):
        StickReader({}, {"fire": 1})


@given(st.lists(st.floats(0.0, 0.1), min_size=1, max_size=100))
def test_a_bucket_never_gives_more_than_its_rate(steps):
    bucket, now, given_out = TokenBucket(100.0, 10.0, 0.0), 0.0, 0
    for step in steps:
        now += step
        for _ in range(20):
            given_out += bucket.take(now)
    assert given_out <= 10.0 + 100.0 * now + 1.0


def test_schedules_stay_on_their_grid_and_make_up_for_nothing():
    schedule = StreamSchedule(0.0, fastest_hz=250.0)
    moments = [now for now in (place * 0.001 for place in range(5000)) if 30 in schedule.take_due(now)]
    assert len(moments) == 250
    assert all(abs(moment - round(moment / 0.02) * 0.02) < 0.0011 for moment in moments)
    schedule.take_due(60.0)
    assert schedule.take_due(60.0) == []
    assert schedule.next_due > 60.0
