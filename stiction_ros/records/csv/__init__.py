"""Records as CSV files."""
