"""Topics of a loop between the graph and what decides on them."""
