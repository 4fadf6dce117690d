"""Blind loops, and what is hidden in them."""
