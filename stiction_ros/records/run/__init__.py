"""What a bag tells of a loop: its record, runs, estimates and modes."""
