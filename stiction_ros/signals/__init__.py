"""What a signal says of itself: noise, lines, cycles, stretches, filters; one of each."""
