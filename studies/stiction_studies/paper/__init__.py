"""The figures and tables of the paper, printed beside those of this package."""
