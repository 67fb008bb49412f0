"""One-sided failures in the closed loop: scheduled and live, on both plants, replayed, and in scenario files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtsim.errors import InputError
from rtsim.faults import fault_kernels as kernels
from rtsim.faults.fault import Fault, FaultSwitch
from rtsim.frame import COLUMN, history_sha256
from rtsim.loop.simulation import FlightSetup, Simulation
from rtsim.lpv.files.storage import load_database, save_database
from rtsim.programme import Programme
from rtsim.units import deg, kt
from scenarios.files.loader import load_scenario

PLANTS = ["lpv", "nonlinear"]


def hold(airspeed, nacelle, **changes):
    programme = Programme.hold(airspeed=kt(airspeed), nacelle_angle=deg(nacelle), altitude=100.0)
    faults = changes.pop("faults", ())
    return FlightSetup(programme=programme, faults=faults).with_options(**changes)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("actuator", ["collective-right", "cyclic-left", "aileron", "rudder"])
def test_the_pilot_holds_the_aircraft_with_one_actuator_stuck(plant, actuator):
    """Nothing moves until a control does: a stuck actuator of trimmed flight is met by a gust from the side."""
    fault = Fault(kind="actuator-hard-over", actuator=actuator, start=0.5, end=0.9, stop="high", rate=deg(4.0))
    simulation = Simulation(hold(100, 60, plant=plant, faults=(fault,)))
    rows = simulation.run(5000)
    assert np.abs(rows[:125, COLUMN.bank_deg]).max() == 0.0
    assert 0.1 < np.abs(rows[:, [COLUMN.bank_deg, COLUMN.sideslip_deg]]).max() < 10.0
    assert np.abs(rows[-1, [COLUMN.bank_deg, COLUMN.sideslip_deg]]).max() < 0.3
    mask = rows[150, COLUMN.failures]
    bits = {"aileron": kernels.MASK_AILERON, "rudder": kernels.MASK_RUDDER}
    assert mask == bits.get(actuator, kernels.MASK_ONE_SIDE)
    assert rows[-1, COLUMN.failures] == 0.0


def test_lpv_and_nonlinear_agree_on_a_runaway_side():
    """Four degrees a second for half a second on one side, at 100 kn: bank within a fifth of its largest value."""
    fault = Fault(kind="actuator-hard-over", actuator="collective-right", start=0.2, end=0.7, stop="high", rate=deg(4))
    flights = [Simulation(hold(100, 60, plant=plant, faults=(fault,))).run(1000) for plant in PLANTS]
    for column in (COLUMN.bank_deg, COLUMN.heading_deg):
        lpv, nonlinear = (np.unwrap(rows[:, column], period=360.0) for rows in flights)
        assert np.abs(nonlinear).max() > 0.2
        assert np.abs(lpv - nonlinear).max() < 0.2 * np.abs(nonlinear - nonlinear[0]).max()


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("control", ["pedal", "lateral-stick", "lever"])
def test_a_jammed_control_stands_whoever_moves_it_and_the_flight_is_the_same_in_pieces(plant, control):
    fault = Fault(kind="control-jammed", control=control, start=1.0, end=2.0)
    kick = Fault(kind="actuator-hard-over", actuator="rudder", start=0.5, end=0.8, stop="high")
    simulation = Simulation(hold(60, 75, plant=plant, faults=(fault, kick)))
    rows = simulation.run(750)
    column = getattr(COLUMN, control.replace("-", "_"))
    assert np.ptp(rows[251:500, column]) == 0.0
    assert np.ptp(rows[500:, column]) > 0.0
    assert rows[300, COLUMN.failures] == kernels.MASK_CONTROL
    simulation.reset()
    pieces = [simulation.run(77)]
    snapshot = simulation.snapshot()
    pieces.append(simulation.run(673))
    assert history_sha256([rows]) == history_sha256(pieces)
    simulation.restore(snapshot)
    assert history_sha256([pieces[0], simulation.run(673)]) == history_sha256([rows])


def test_a_live_failure_is_that_of_the_schedule():
    fault = Fault(kind="actuator-stuck", actuator="cyclic-right", start=0.4)
    kick = Fault(kind="actuator-hard-over", actuator="rudder", start=0.2, end=0.6, stop="low")
    scheduled = Simulation(hold(60, 75, faults=(kick, fault))).run(400)
    simulation = Simulation(hold(60, 75, faults=(kick,)))
    before = simulation.run(100)
    simulation.disturb(FaultSwitch(fault, on=True))
    assert history_sha256([before, simulation.run(300)]) == history_sha256([scheduled])


def test_an_aircraft_with_one_half_refuses_it_scheduled_and_live(tmp_path):
    save_database(dataclasses.replace(load_database(), lateral=None), tmp_path / "flat.nc")
    fault = Fault(kind="actuator-stuck", actuator="rudder", start=0.0)
    with pytest.raises(InputError, match="plane of symmetry alone"):
        Simulation(hold(60, 75, database=str(tmp_path / "flat.nc"), faults=(fault,)))
    simulation = Simulation(hold(60, 75, database=str(tmp_path / "flat.nc")))
    with pytest.raises(InputError, match="plane of symmetry alone"):
        simulation.disturb(FaultSwitch(fault, on=True))


def test_a_scenario_file_says_it(tmp_path):
    file = tmp_path / "jam.toml"
    file.write_text(
        'format = 1\nname = "jam"\ntitle = "Jam"\nduration_s = 2\n[start]\ncondition = "hover"\n'
        '[[faults]]\nkind = "control-jammed"\ncontrol = "pedal"\ntime_s = 1\n'
        '[[faults]]\nkind = "actuator-stuck"\nactuator = "collective-left"\ntime_s = 1.5\n'
    )
    faults = load_scenario(file).faults
    assert [fault.name for fault in faults] == ["pedal-jammed", "collective-left-stuck"]
