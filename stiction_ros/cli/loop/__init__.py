"""Commands about one loop: identify, gap, gain, simulate."""
