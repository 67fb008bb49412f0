"""Measurements. They print numbers and assert nothing, since machines differ."""
