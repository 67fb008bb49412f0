"""Envelope protection."""
