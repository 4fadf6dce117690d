"""Linear models of whole records, state space."""
