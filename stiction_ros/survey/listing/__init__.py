"""The ranked list: its page and its tables."""
