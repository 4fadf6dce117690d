"""Nodes for tests of others: yardsticks, and the suite of faults in the graph."""
