"""Valve stiction in model predictive control: simulate, identify, compensate, record.

Floors, lowest first; each imports only what stands below it, and nothing below
:mod:`stiction_ros.nodes` imports rclpy::

    effects  processes  records  loop  identification  control  online  report  cli  nodes
"""

__version__ = "0.1.0"
