"""The paper as printed.

- :mod:`.methods`: identification by its methods: the nonlinear programme (12), its grid search.
- :mod:`.programme`: the programme (12); :mod:`.smoothed_laws`: its friction laws (5), (6).
- :mod:`.controllers`: its three controllers, (19) to (22), with the weights of Section 4.2.

It is imported from these modules, as a controller that is not the paper's loads none of it but
:mod:`.controllers`.
"""
