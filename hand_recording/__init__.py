"""Recordings: written, repaired, loaded as arrays."""
