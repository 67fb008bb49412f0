"""The search for the flight that breaks a law, and for how likely such a flight is."""
