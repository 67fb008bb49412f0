"""Aircraft: their states, inputs and outputs as data, and the XV-15 made from published data."""
