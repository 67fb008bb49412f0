"""Databases on disk: NetCDF for people and programs, MAT for MATLAB."""
