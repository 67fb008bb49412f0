"""The ``rtsim`` command, one module per group of commands: the only part of rtsim that imports telemetry, scenarios."""
