"""A hand in the browser: its 3-D view, live or from a recording, and the controls of a running hand."""
