"""Effects of the process. One behaviour a file."""
