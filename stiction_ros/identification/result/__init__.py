"""What identification returns, as values."""
