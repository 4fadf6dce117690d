"""The loop closed again with what was identified, and what makes it oscillate.

Nothing is imported here: closing a loop takes compiled code, looking for an oscillation does not.
"""
