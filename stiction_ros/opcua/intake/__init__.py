"""What is read of a control system once: its history, and the tags that it has."""
