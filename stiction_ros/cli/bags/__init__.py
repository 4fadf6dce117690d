"""Commands about bags: convert, repair, replay, report."""
