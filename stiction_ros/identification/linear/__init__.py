"""Linear models of whole records: ARX, ARMAX, state space."""
