"""From a person's sticks to a command: shaping, nacelle switch, conversion by command, loss of input and recovery."""
