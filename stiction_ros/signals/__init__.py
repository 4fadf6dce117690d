"""What recorded signals say by themselves: noise, lines, cycles, stretches, the controller."""
