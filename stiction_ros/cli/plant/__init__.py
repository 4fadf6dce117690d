"""Commands about a whole plant: all its loops, and its control system."""
