"""Effects of valves but for stiction. One behaviour a file."""
