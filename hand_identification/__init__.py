"""Identification of the numbers of a known model: sensors, static map, dynamics, free parameters and their fit."""
