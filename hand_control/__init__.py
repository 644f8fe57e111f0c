"""Reference and state to valve pressures: the control law, and one thin node."""
