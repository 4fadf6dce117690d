"""The process where it is not given or not right: identified, fitted again, changed."""
