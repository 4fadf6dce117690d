"""Pages for the shift: HTML that holds all it shows, in light and dark, on a phone and on paper."""
