"""The flight log: written without loss, read at any moment, exported, drawn."""
