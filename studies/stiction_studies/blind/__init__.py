"""Blind tests: loops with a hidden effect, and the score of whoever names it."""
