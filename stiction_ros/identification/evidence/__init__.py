"""How likely a record is under a friction: stems through any smooth process, noise beside it.

:mod:`.problem` prepares a record, :mod:`.candidate` is the objective, :mod:`.search` finds the
frictions that explain a record best, :mod:`.accepted` those that it does not reject.
"""
