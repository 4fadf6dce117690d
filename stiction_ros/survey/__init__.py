"""Every loop of a plant, ranked by what to service first.

Nothing is imported here: assessing takes compiled code, listing what was found does not.
"""
