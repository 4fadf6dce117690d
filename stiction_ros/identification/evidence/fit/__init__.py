"""How well stems explain an output: the one function that everything is judged by."""
