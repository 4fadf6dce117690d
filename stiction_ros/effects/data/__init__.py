"""Effects of the record and its controller. One behaviour a file."""
