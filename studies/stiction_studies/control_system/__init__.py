"""A simulated plant with its own control system behind a real OPC UA server, to try things on."""
