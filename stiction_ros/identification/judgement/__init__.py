"""The judgement of a valve: named figures, one probability, two cuts."""
