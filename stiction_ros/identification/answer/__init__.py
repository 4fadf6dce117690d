"""What is told beside the figures: how steady they are, what would decide, a loop to simulate."""
