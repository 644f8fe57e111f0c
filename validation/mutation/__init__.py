"""Mutation tests: how many small changes of the code the fast tests detect, counted with cosmic-ray."""
