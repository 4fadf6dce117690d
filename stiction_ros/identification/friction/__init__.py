"""The frictions that are searched: the triangle of f_S and f_D, and further parameters."""
