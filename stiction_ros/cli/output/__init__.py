"""What commands show: results as JSON, progress."""
