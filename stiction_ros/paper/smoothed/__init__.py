"""Friction laws with smooth switches, and the stems that they give."""
