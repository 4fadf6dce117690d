"""What recorded signals say by themselves, before any model of a loop."""
