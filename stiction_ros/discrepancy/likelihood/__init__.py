"""How likely a gap is: autoregressive noise, declared or found, and rounded values."""
