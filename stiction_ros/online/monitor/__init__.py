"""Whether the gap between loop and model grows, and what it is."""
