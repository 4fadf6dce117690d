"""Candidates: one change of a model each, with figures to be searched."""
