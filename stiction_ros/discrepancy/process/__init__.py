"""The process fitted anew behind the effects, where it is not given."""
