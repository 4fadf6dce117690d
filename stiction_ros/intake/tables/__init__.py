"""From the cells of tables to blocks of signals, one loop each."""
