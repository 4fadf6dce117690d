"""The running loop that faults are put into."""
