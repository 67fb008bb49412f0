"""Pacing: flies any source of frames on the wall clock's schedule and measures how well that went."""
