"""Compiled sums over samples that the searches share."""
