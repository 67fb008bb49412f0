"""The closed loop: what a flight is set up with, and its frame in the order it runs."""
