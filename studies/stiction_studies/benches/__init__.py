"""``stiction bench``: speed side by side, and how often answers are right."""
