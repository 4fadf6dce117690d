"""Self-contained HTML reports, their figures, and the scores of a run."""
