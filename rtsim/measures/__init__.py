"""What a flight is judged by."""
