"""The valve test: a record of steps of OP in manual is judged, and the next steps are planned."""
