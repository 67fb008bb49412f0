"""Pilot aids between the hands and the control mixing: damping, attitude retention, holds, trim bias."""

from rtsim.aids.design import AIDS, AidName, aid_of, design_aids, switches_of

__all__ = ["AIDS", "AidName", "aid_of", "design_aids", "switches_of"]
