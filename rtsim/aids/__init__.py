"""Pilot aids between the hands and the control mixing: damping, attitude retention, holds, trim bias."""

from rtsim.aids.design import AIDS, SWITCHES, design_aids, switch_of, switches_of

__all__ = ["AIDS", "SWITCHES", "design_aids", "switch_of", "switches_of"]
