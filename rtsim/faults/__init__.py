"""Failures of nacelles, actuators, airspeed sensor and engine, scheduled or live."""
