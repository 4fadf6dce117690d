"""What service, another controller or another tuning would bring to a loop, simulated.

Nothing is imported here: simulating takes compiled code, naming the options does not.
"""
