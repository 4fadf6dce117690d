"""The ROS-free heart of the live loop: window, trust, swap, watch.

:mod:`.session` runs it all in one process; the nodes run the same parts apart.
"""
