"""The best figures of a candidate, and how sure they are."""
