"""What leaves the simulator: the row ring, the flight log and its reader, the Rerun view, and plots.

Nothing here is imported by the loop's own parts; every module takes names and units from ``rtsim.frame``.
"""
