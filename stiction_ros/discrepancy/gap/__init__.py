"""What the gap is: how large, where, and how much of it is noise."""
