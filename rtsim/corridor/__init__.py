"""The conversion corridor: boundaries, signed margins and warning levels."""
