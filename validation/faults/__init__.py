"""The campaign of faults: what is injected, whether it is detected, and how soon."""
