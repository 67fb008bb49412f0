"""Flaps and rotor drive: what moves the flaps, and what the rotor speed does with and without its governor."""
