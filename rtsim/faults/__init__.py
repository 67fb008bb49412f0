"""Failures of nacelles, actuators, airspeed sensor and engine, scheduled or live.

The package itself hands out the data types only; the schedule and the state are in ``rtsim.faults.schedule``.
"""

from rtsim.faults.fault import Fault, FaultEvent, FaultSwitch, fault_events

__all__ = ["Fault", "FaultEvent", "FaultSwitch", "fault_events"]
