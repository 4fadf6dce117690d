"""Bags as messages: read, written, finished, mended, played."""
