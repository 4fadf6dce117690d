"""Pages of studies: controllers side by side, an example beside its truth."""
