"""The one assembly of the equations of a joint: rows of parameters and state, composed effects, terms and loops."""
