"""A bridge without ROS in a thread or a process of its own, with a controller that moves OP."""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiction_ros.opcua.grant import Grant, GrantState
from stiction_ros.opcua.loop_bridge import BridgeRules, LoopBridge
from stiction_ros.opcua.plant_link import (
    Heard,
    Linked,
    OpcuaNodeSettings,
    PlantLink,
    Refused,
    Written,
)
from stiction_ros.opcua.sampling import PlantSample
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.tag_map import TagMap

SENDER = "/controller"
SWING = 12.0  # %; the controller asks for steps of twice that


class BridgeRunner:
    """Serves one loop as the node does; OP is asked to step up and down every few samples."""

    def __init__(
        self,
        map_file: str,
        url: str,
        credentials: Credentials,
        *,
        speed: float,
        identity: int = 7,
        asks: bool = True,
    ) -> None:
        self.tags = TagMap.load(map_file).loops[0]
        written = dict(self.tags.uses())
        settings = OpcuaNodeSettings(url=url, publishing=0.02, **vars(credentials))
        self.link = PlantLink(settings, self.tags.read_tags(), written)
        rules = BridgeRules(speed, True, asks, SENDER, identity)
        self.bridge = LoopBridge(self.tags, rules, time.monotonic())
        self.samples: list[PlantSample] = []
        self.grants: list[Grant] = [self.bridge.grant]
        self.links: list[Linked] = []
        self.commands = True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> None:
        self.link.start()
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()
        self.link.submit(self.bridge.give_back(time.monotonic(), "the runner stops"))
        self.link.stop()

    @property
    def state(self) -> GrantState:
        return self.bridge.grant.state

    def _serve(self) -> None:
        while not self._stop.is_set():
            for event in self.link.drain():
                now = time.monotonic()
                if isinstance(event, Heard):
                    self.link.submit(self.bridge.hear(event.tag, event.reading, event.at))
                elif isinstance(event, Written):
                    done = (event.order, event.failure, event.seconds, now)
                    self.link.submit(self.bridge.written(*done))
                elif isinstance(event, Refused):
                    self.link.submit(self.bridge.refuse(event.tags, now))
                else:
                    self.links.append(event)
            now = time.monotonic()
            self.link.submit(self.bridge.linked(self.link.alive(now), now))
            for sample in self.bridge.samples(now):
                self.samples.append(sample)
                self._command(sample, now)
            if self.bridge.grant != self.grants[-1]:
                self.grants.append(self.bridge.grant)
            time.sleep(0.005)

    def _command(self, sample: PlantSample, now: float) -> None:
        if self.commands:
            up = (len(self.samples) // 7) % 2
            op = np.array([50.0 + SWING * (2 * up - 1), 50.0])
            _, orders = self.bridge.command(SENDER, sample.stamp, op, now)
            self.link.submit(orders)


class BridgeProcess:
    """The same in a process, to be killed."""

    def __init__(self, folder: Path, **told: Any) -> None:
        path = folder / f"bridge_{told['identity']}.yaml"
        path.write_text(yaml.safe_dump(told), encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-P", __file__, str(path)], stdout=subprocess.PIPE, text=True
        )

    def wait_for(self, state: str) -> None:
        assert self.process.stdout is not None
        assert any(line.strip() == state for line in self.process.stdout), f"never {state}"

    def stop(self, number: int = signal.SIGTERM) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)
        self.process.wait(30.0)
        if self.process.stdout is not None:
            self.process.stdout.close()


def main() -> None:
    told = yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8"))
    credentials = Credentials(**told.pop("credentials"))
    runner = BridgeRunner(
        told["map_file"], told["url"], credentials, speed=told["speed"], identity=told["identity"]
    )
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda _number, _frame: over.set())
    runner.start()
    shown = 0
    while not over.wait(0.01):
        for grant in runner.grants[shown:]:
            print(grant.state.value, flush=True)
            shown += 1
    runner.stop()


if __name__ == "__main__":
    main()
