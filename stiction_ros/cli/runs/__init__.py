"""What commands run: scenarios, processes of nodes, many seeds."""
