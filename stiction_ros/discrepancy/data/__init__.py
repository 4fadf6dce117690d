"""What is wrong with the records, before any effect is searched."""
