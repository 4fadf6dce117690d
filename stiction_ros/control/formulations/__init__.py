"""How OP is planned: unaware of friction, by inversion, by exact embedding."""
