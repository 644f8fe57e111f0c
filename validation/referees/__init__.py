"""Referees of the diagnosis: plants, laws and kinds of physics that neither the catalogue nor the trial's plant has."""
