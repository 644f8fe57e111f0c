"""Machines of one axis other than a hand: their description, model, recordings and units."""
