"""Every loop of a plant, ranked by what to service first; nothing is imported here."""
