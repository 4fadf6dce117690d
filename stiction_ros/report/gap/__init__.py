"""The report of a discrepancy."""
