"""Scores, what they allow to say, and the model with the effect in it."""
