"""How a controller is tuned: the settings of its user, and the design made of them."""

from stiction_ros.tuning.settings import ControlSettings

__all__ = ["ControlSettings"]
