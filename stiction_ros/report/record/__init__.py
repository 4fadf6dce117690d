"""Sections of the report of one record."""
