"""Makes a database: trims and linear models over the grid, and their checks."""
