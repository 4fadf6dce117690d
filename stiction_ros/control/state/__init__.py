"""State and disturbance from PV and the OP that was applied."""
