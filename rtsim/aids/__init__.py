"""Pilot aids between the hands and the control mixing: damping, attitude retention, holds, trim bias."""
