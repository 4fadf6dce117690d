"""The paper as printed: its methods of identification, and its three controllers, (19) to (22)."""
