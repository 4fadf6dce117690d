"""What judges ``stiction_ros``.

Worlds whose truth is known (:mod:`.field`, :mod:`.blind`, :mod:`.examples`), benchmarks, studies,
faults put into running nodes, a simulated control system, and the figures and tables of the paper.
"""
