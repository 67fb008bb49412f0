"""Scenario files: layout, reading, checking; what they mean in SI."""
