"""What options several commands have, and how they are read."""
