"""What all pages share: the frame with its style, and figures that can be zoomed."""
