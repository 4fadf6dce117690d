"""Where the loops of a survey are judged."""
