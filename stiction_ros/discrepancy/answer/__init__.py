"""What is handed over: effects found, words, what was not considered, what would decide."""
