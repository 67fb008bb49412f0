"""FlightGear as a window on the world: packets from a process of its own, and the aircraft that it shows."""
