"""The estimator of a running loop, and when it is trusted."""
