"""The steps of a gap run: each takes a state and returns another."""
