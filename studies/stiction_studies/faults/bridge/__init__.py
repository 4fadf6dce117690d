"""Faults between a control system and its bridge: real processes, a real server, no mocks."""
