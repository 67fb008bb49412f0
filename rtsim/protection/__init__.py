"""Envelope protection: margin monitor, boundaries, laws compiled and in Python."""
