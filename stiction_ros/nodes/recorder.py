"""The recorder: every topic of the graph into one MCAP bag."""

from __future__ import annotations

import dataclasses
import re
import struct
from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosidl_runtime_py.utilities import get_message

from stiction_ros.errors import InputError
from stiction_ros.nodes.managed import ManagedNode
from stiction_ros.nodes.messages import SECOND
from stiction_ros.nodes.runner import run
from stiction_ros.nodes.shared import NodeSettings
from stiction_ros.records.bag_writer import BagWriter, Qos
from stiction_ros.records.message_definitions import definition
from stiction_ros.settings import setting

DISCOVERY_PERIOD = 0.05  # s between two looks at the graph
READER_DEPTH = 5000  # messages kept by the reader while the process is busy
