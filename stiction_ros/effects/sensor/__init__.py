"""Effects of sensors. One behaviour a file."""
