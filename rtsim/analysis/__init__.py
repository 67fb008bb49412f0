"""Offline answers about aircraft and pilot: trims, linear models, frozen loops, handling, stability along a path."""
