"""Switching patterns: when a valve slips, and which frictions do that alike."""
