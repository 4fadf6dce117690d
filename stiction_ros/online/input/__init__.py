"""What reaches a controller, and which of it counts."""
