"""The faults themselves, by what they strike."""
