"""The finite-horizon problem: cost, limits, target, the paper's weights."""
