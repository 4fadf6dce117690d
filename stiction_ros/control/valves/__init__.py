"""Where the stems of sticky valves are believed to be."""
