"""What all nodes have: lifecycle, parameters, peers, messages, the process."""
