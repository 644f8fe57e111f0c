"""Bytes of a valve and sensor board to frames, frames to SI units, and one thin node."""
