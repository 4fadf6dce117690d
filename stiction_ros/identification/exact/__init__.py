"""The exact search: grids, switching patterns near them, narrow patterns grown piece by piece."""
