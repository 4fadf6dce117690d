"""Windows of samples, PV and OP paired."""
