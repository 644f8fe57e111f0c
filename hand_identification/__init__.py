"""Identification: sensors, static map, dynamics, free parameters and their fit."""
