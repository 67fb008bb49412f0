"""The Rerun view of a flight."""
