"""The model driven by the recorded OP, for one stem or many."""
