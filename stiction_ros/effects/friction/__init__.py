"""Laws of stiction. One behaviour a file."""
