"""Protection while flying: limits and interventions told as they happen, laws of one's own, override, and replays."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

import numpy as np
import pytest

import scenarios
from rtsim.cli.main import run
from rtsim.frame import COLUMN
from rtsim.processes import safe_environment
from rtsim.protection.monitor import MarginMonitor
from rtsim.realtime.control import FlightControl
from scenarios.files.options import Overrides
from scenarios.flight.limit_watch import LimitWatch
from scenarios.flight.replay import replay_log
from scenarios.flight.runner import FlightOutputs
from telemetry.log.format import LogEvent

LAWS = """
import time
from dataclasses import replace


class Softens:
    def step(self, sensors, command, margins, dt):
        return replace(command, stick=0.9 * command.stick), []


class Raises(Softens):
    def step(self, sensors, command, margins, dt):
        if sensors.time > 0.5:
            raise RuntimeError("no more")
        return super().step(sensors, command, margins, dt)


class Greedy(Softens):
    def step(self, sensors, command, margins, dt):
        return replace(command, lever=1.5), []


class Dawdles(Softens):
    def step(self, sensors, command, margins, dt):
        if 0.39 < sensors.time < 0.41:
            time.sleep(0.07)
        return super().step(sensors, command, margins, dt)
"""


@pytest.fixture
def own_laws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "live_laws.py").write_text(LAWS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def told(flight: scenarios.FlightRecord, *kinds: str) -> list[tuple[int, str]]:
    return [(event.frame, event.text) for event in flight.events if event.kind in kinds]


def test_limits_and_interventions_are_told_alike_at_any_speed() -> None:
    """The events of a paced flight, looked at ten rows at a time, are those of one flown in pieces of a second."""
    overrides = Overrides(protection="governor", duration=22.0)
    quick = scenarios.fly("ep06_overspeed", speed="max", overrides=overrides)
    paced = scenarios.fly("ep06_overspeed", speed=100.0, overrides=overrides)
    events = told(quick, "limit", "protection")
    assert events == told(paced, "limit", "protection")
    assert events == sorted(events, key=lambda event: event[0])
    assert any("nacelles protected: high-speed side of the corridor" in text for _, text in events)
    assert any("mast torque warning" in text for _, text in events)
    assert quick.summary()["limits"] == paced.summary()["limits"]
    assert quick.history_sha256 == paced.history_sha256


def test_least_margins_are_those_of_the_monitor() -> None:
    flight = scenarios.fly("ep11_jam_60_accelerating", speed="max", overrides=Overrides(duration=30.0))
    expected = MarginMonitor(flight.scenario.options.corridor_name).history(flight.rows).limits
    limits = flight.summary()["limits"]
    assert {
        "stall_attitude",
        "load_torque",
        "flap_stop",
        "mast_torque",
        "load_factor",
        "pitch_attitude",
        "sink",
    } <= set(limits)
    for name, found in limits.items():
        if name != "time_to_limit":  # the monitor after the fact has no access to the airspeed that was indicated
            assert found["worst_margin"] == pytest.approx(expected[name]["worst_margin"], rel=1e-12), name
            assert found["outside_s"] == pytest.approx(expected[name]["outside_s"], abs=1e-9), name


def test_without_protection_nobody_watches() -> None:
    flight = scenarios.fly("hover", speed="max", overrides=Overrides(duration=1.0, protection="off"))
    assert "limits" not in flight.summary()


def test_an_episode_of_protection_ends() -> None:
    flight = scenarios.fly("ep04_wrong_nacelle_command", speed="max", overrides=Overrides(protection="governor"))
    texts = [text for _, text in told(flight, "protection")]
    assert texts[0].startswith("nacelles protected: low-speed side of the corridor")
    assert any(text.startswith("protection has let go after") for text in texts)
    acted = flight["protection_nacelle_reason"] != 0.0
    found = flight.summary()["interventions"]
    assert found["nacelles_s"] == pytest.approx(np.count_nonzero(acted) * 0.004)
    assert found["stick_s"] == found["lever_s"] == 0.0
    assert found["episodes"] == 1 + sum(
        "let go" in earlier and "protected" in later for earlier, later in itertools.pairwise(texts)
    )


def test_a_law_of_ones_own_flies_and_replays(own_laws: Path) -> None:
    log = own_laws / "a.parquet"
    overrides = Overrides(protection="live_laws:Softens, full", duration=3.0)
    flight = scenarios.fly("typical_conversion", speed="max", overrides=overrides, outputs=FlightOutputs(log=log))
    assert flight.completed
    assert flight.summary()["corridor_name"] == "flight"
    np.testing.assert_allclose(flight["stick"][0], 0.9 * flight["pilot_stick"][0])
    assert replay_log(log, trust=True).same


@pytest.mark.parametrize("speed", ["max", 1.0])
def test_a_law_that_raises_is_named_and_the_flight_goes_on(own_laws: Path, speed: float) -> None:
    log = own_laws / "a.parquet"
    overrides = Overrides(protection="live_laws:Raises", duration=1.0)
    flight = scenarios.fly("typical_conversion", speed=speed, overrides=overrides, outputs=FlightOutputs(log=log))
    assert flight.completed
    assert told(flight, "law") == [
        (130, "the law live_laws:Raises raised RuntimeError: no more; the flight goes on without it")
    ]
    assert flight["stick"][135] == flight["pilot_stick"][135]
    assert replay_log(log, trust=True).same


def test_a_law_that_asks_for_too_much_is_named_though_the_warm_up_met_it_first(own_laws: Path) -> None:
    overrides = Overrides(protection="live_laws:Greedy", duration=0.2)
    flight = scenarios.fly("hover", speed="max", overrides=overrides)
    assert [frame for frame, text in told(flight, "law") if "clipped" in text] == [0]
    assert (flight["lever"] == 1.0).all()


def test_a_reset_in_the_first_frames_begins_the_levels_anew() -> None:
    """Ten rows are looked at together; a reset among them must part them."""
    rows = scenarios.fly("hover", speed="max", overrides=Overrides(duration=0.2)).rows
    events: list[object] = []
    watch = LimitWatch("design", events.append, dt=0.004)
    for row in (*rows[:4], *rows[:20]):
        watch.row(row)
    assert watch._frame == 19  # 4 rows, then two batches of ten; not parted, the last batch would end with row 15


def test_limits_that_only_caution_are_told_as_cautions() -> None:
    """The others from a warning on: a caution of the torque belongs to every climb."""
    rows = scenarios.fly("hover", speed="max", overrides=Overrides(duration=4.0)).rows.copy()
    rows[250:350, COLUMN.thrust_coefficient_over_solidity] = 0.2
    rows[500:600, COLUMN.engine_power_shp] = 0.95 * rows[500:600, COLUMN.engine_power_available_shp]
    rows[700:800, COLUMN.engine_power_shp] = 1.1 * rows[700:800, COLUMN.engine_power_available_shp]
    events: list[LogEvent] = []
    watch = LimitWatch("design", events.append, dt=0.004)
    watch.rows(rows)
    assert [(event.frame, event.text, event.level) for event in events] == [
        (274, "rotor endurance caution: 11.2 % beyond the limit", "caution"),
        (599, "rotor endurance clear again", "info"),
        (724, "engine power exceedance: 10.0 % beyond the limit", "exceedance"),
    ]
    limits = watch.summary()["limits"]
    assert limits["rotor_endurance"]["outside_s"] == pytest.approx(0.4)
    assert limits["engine_power"] == {
        "worst_margin": pytest.approx(-10.0),
        "unit": "%",
        "outside_s": pytest.approx(0.4),
    }


def test_calls_that_a_slow_law_missed_live_are_missed_in_the_replay(own_laws: Path) -> None:
    log = own_laws / "a.parquet"
    overrides = Overrides(protection="live_laws:Dawdles", duration=1.0)
    flight = scenarios.fly("typical_conversion", speed=1.0, overrides=overrides, outputs=FlightOutputs(log=log))
    skipped = [frame for frame, text in told(flight, "law") if "was skipped" in text]
    assert skipped[:3] == [105, 110, 115]  # 70 ms are three and a half periods of 20 ms
    assert flight["stick"][107] == flight["pilot_stick"][107] != 0.0
    assert replay_log(log, trust=True).same


def test_the_pilot_overrides_the_protection_and_gives_it_back(tmp_path: Path) -> None:
    """A forward switch at 60 kn: held by the governor, let through while overridden, held again."""
    control = FlightControl()
    control.step(1500)
    script = deque([lambda: (control.override_protection(), control.step(100)), control.resume])
    control.poll = lambda: script.popleft()() if script else None
    log = tmp_path / "a.parquet"
    flight = scenarios.fly(
        "ep04_wrong_nacelle_command",
        speed="max",
        overrides=Overrides(protection="governor", duration=8.0),
        control=control,
        outputs=FlightOutputs(log=log),
    )
    assert told(flight, "override") == [(1500, "the pilot overrides the protection")]
    reasons = flight["protection_nacelle_reason"]
    assert reasons[1499] != 0.0
    assert not reasons[1500:].any()
    assert replay_log(log, trust=True).same


def test_a_law_that_does_not_exist_is_a_mistake_of_the_user(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fly", "hover", "--headless", "--speed", "max", "--protection", "govenor"]) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert "govenor" in message
    assert "perhaps 'governor' is meant" in message


def test_the_law_of_the_documentation_flies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "protection.md").read_text(encoding="utf-8")
    code = re.search(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    assert code is not None
    (tmp_path / "documented_law.py").write_text(code[1], encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    overrides = Overrides(protection="documented_law:StopTheNacelles")
    flight = scenarios.fly("ep04_wrong_nacelle_command", speed="max", overrides=overrides)
    bare = scenarios.fly("ep04_wrong_nacelle_command", speed="max", overrides=Overrides(protection="monitor"))
    assert told(flight, "law") == []
    assert "nacelles protected: low-speed side of the corridor" in {event.text for event in flight.events}
    assert flight["nacelle_deg"].min() > bare["nacelle_deg"].min() + 10.0


def test_the_limit_watch_compiles_nothing_once_rows_come() -> None:
    """Its kernels are ready before the flight begins, also the first time they are ever used."""
    fresh = "from scenarios.flight.limit_watch import LimitWatch; import numpy as np; "
    fresh += "from rtsim.protection.monitor_kernels import watch; "
    fresh += "from rtsim.frame import SIGNAL_COUNT; w = LimitWatch('design', print, dt=0.004); "
    fresh += "before = list(watch.signatures); w.rows(np.zeros((10, SIGNAL_COUNT))); "
    fresh += "assert before and list(watch.signatures) == before"
    subprocess.run([sys.executable, "-c", fresh], env=safe_environment(), check=True)
