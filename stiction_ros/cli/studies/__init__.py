"""Commands of the studies: examples, the paper, scenarios over many seeds."""
