"""From the best model to a verdict: intervals, units, what is exact."""
