"""The LPV aircraft: database, its build and checks, compiled kernels, and the aircraft object."""
