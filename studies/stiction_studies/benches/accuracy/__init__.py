"""How often right: answers counted over loops whose truth is known."""
