"""Commands that start the nodes: the demo, faults, the long run."""
