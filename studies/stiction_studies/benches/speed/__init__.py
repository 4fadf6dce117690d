"""How fast: rows of times, side by side."""
