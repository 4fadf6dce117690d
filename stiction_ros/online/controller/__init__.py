"""The controller of a running loop."""
