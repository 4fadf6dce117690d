"""How likely a record is under a friction: stems through any smooth process, noise beside it.

:mod:`.fit` judges, :mod:`.search` finds the frictions that explain a record best, :mod:`.accepted`
those that it does not reject, :mod:`.rates` does so at several rates, and :mod:`.engine` concludes.
"""
