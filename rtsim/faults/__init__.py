"""Failures of nacelles, actuators, airspeed sensor and engine, scheduled or live."""

from rtsim.faults.fault import Fault, FaultEvent, fault_events, fault_tables, new_fault_state

__all__ = ["Fault", "FaultEvent", "fault_events", "fault_tables", "new_fault_state"]
