"""The report of a run: page, figures, scores, story."""
