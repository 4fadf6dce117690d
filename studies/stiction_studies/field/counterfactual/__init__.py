"""Loops of the field run again with something changed: what would have been."""
