"""The exact search: grids, also over growing beginnings, and switching patterns near them."""
