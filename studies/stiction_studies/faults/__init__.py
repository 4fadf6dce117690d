"""Faults put into a running graph, and what is judged of it.

A :class:`.fault.Fault` says what is done and what is expected; :mod:`.case` runs it on real
processes, :mod:`.judgement.judge` holds what was seen against it.
"""
