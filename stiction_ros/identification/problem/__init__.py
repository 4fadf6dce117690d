"""A record made ready, and the models that are fitted to it."""
