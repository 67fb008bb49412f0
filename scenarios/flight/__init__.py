"""One flight: composed, flown live or as fast as it goes, recorded, replayed."""
