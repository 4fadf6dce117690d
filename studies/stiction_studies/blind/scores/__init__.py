"""What was hidden against what was said, counted."""
