"""The status of a bridged loop: the worst of what is wrong with it, in words and keys."""

from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from small_maps import PV, at
from test_loop_bridge import Plant

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from stiction_ros.nodes.opcua_topics import LoopTopics
from stiction_ros.opcua.sampling import PlantSample, TagQuality


class Status:
    """A loop whose controller is granted, and what is told of it."""

    def __init__(self) -> None:
        self.plant = Plant().granted()
        self.topics = LoopTopics(MagicMock(), self.plant.bridge)
        one = np.array([10.0])
        quality = (TagQuality.GOOD,)
        sample = PlantSample(at(0.0), one, one, np.zeros(0), np.zeros(1), quality, one)
        self.topics.publish(sample, "/controller")

    def now(self) -> tuple[str, str, dict[str, Any]]:
        level, text, values = self.topics.health(self.plant.now)
        return level, text, dict(values)


def test_cut_ops_are_a_warning_with_their_counts() -> None:
    status = Status()
    plant = status.plant
    plant.run(60, wanted=plant.op)
    assert status.now()[:2] == ("ok", "granted: granted by the mode")
    plant.run(3, wanted=plant.op + 9.2)
    level, text, values = status.now()
    assert level == "warn"
    assert text.startswith("OP of V1 is cut by the map's rate of 2 %/s at 3 of the last 60")
    assert (values["rate_cut:V1"], values["wanted_step:V1"]) == (3, "9.2")
    plant.set_mode("AUTO")
    assert status.now()[:2] == ("ok", "idle: taken back by the mode")


def test_refused_tags_are_an_error_and_the_first_three_are_named() -> None:
    status = Status()
    plant = status.plant
    names = [PV, *dict(plant.bridge.tags.uses())]
    plant.do(plant.bridge.refuse(dict.fromkeys(names, "no") | {PV: "is refused (BadX)"}, plant.now))
    level, text, values = status.now()
    assert level == "error"
    assert text == "tag s=PV is refused (BadX); tag s=BEAT no; tag s=REQUEST no; and 1 more"
    assert values["refused_tags"] == 4
