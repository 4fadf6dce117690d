"""What identification found, as parts of a page: verdicts, frictions, process, responses."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stiction_ros.effects import Stiction, behaviours
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import VerdictKind
from stiction_ros.loop import LoopModel
from stiction_ros.pages.plot import KINDS as COLOURS
from stiction_ros.pages.plot import Curve, over_time
from stiction_ros.pages.signals import Units
from stiction_ros.records.record import Record
from stiction_ros.report.page import Cell, card, interval, number, percent, table
from stiction_ros.signals.arx import step_response as answer_to_step
from stiction_ros.signals.polynomials import largest_root
from stiction_ros.texts import probability, spoken, symbol

if TYPE_CHECKING:
    from stiction_ros.report.run.story import Story  # it loads the controllers

KINDS = {"sticky": "bad", "backlash": "bad", "healthy": "good"}  # of boxes; others are open


def verdict_line(valves: Sequence[Mapping[str, Any]]) -> str:
    """Return the verdicts on all valves in a few words."""
    if not valves:
        return "No fit of the valves"
    said = {
        kind: [valve["name"] for valve in valves if valve["verdict"] == kind]
        for kind in ("sticky", "backlash")
    }
    told = []
    if names := said["sticky"]:
        told.append(f"{_listed(names)} {'sticks' if len(names) == 1 else 'stick'}")
    if names := said["backlash"]:
        listed = _listed(names) if not told else ", ".join(names)
        told.append(f"{listed} {'has' if len(names) == 1 else 'have'} backlash")
    if told:
        return ", ".join(told)
    one = len(valves) == 1
    if all(valve["verdict"] == "healthy" for valve in valves):
        return f"{_listed([v['name'] for v in valves])} {'is' if one else 'are'} healthy"
    return "No valve is shown to stick"


def has_friction(valve: Mapping[str, Any]) -> bool:
    """Tell whether an entry of ``valves`` of ``identify --json`` finds friction."""
    return VerdictKind(valve["verdict"]).has_friction


def valve_cards(valves: Sequence[Mapping[str, Any]], story: "Story | None" = None) -> str:
    """Return one box a valve: verdict, friction with intervals, and the truth where known."""
    boxes = []
    for valve in valves:
        more = (
            f"f_S {percent(valve['f_s'])} % ({interval(valve['f_s_interval'])}), "
            f"f_D {percent(valve['f_d'])} % ({interval(valve['f_d_interval'])}), 95 % intervals"
        )
        more += "".join(f"\n{said}" for said in _further(valve))
        if valve["verdict"] == "healthy":
            more = f"f_S at most {percent(valve['f_s_interval'][1])} % of travel"
        if chance := probability(valve.get("probability")):
            more += f"\nprobability of friction {chance}"
        truth = None if story is None else story.true_friction(valve["name"])
        if truth is not None:
            more += f"\nsimulated with f_S = {truth[0]:g} %, f_D = {truth[1]:g} %"
        kind = KINDS.get(valve["verdict"], "open")
        boxes.append(card(kind, valve["name"], valve["verdict"], more))
    return f'<div class="cards">{"".join(boxes)}</div>' if boxes else ""


def _further(valve: Mapping[str, Any]) -> list[str]:
    """Return the parameters of a law behind its first two, one sentence each."""
    said = []
    for kind in behaviours():
        if kind.effect != Stiction.effect or kind.law != valve.get("law"):
            continue
        for entry in kind.parameters()[2:]:
            if valve.get(entry.key) is None:
                continue
            unit = "" if entry.unit == "1" else f" {entry.unit}"
            ends = valve.get(f"{entry.key}_interval")
            between = "held" if ends is None else f"{number(ends[0])} … {number(ends[1])}"
            value = number(valve[entry.key])
            said.append(f"{symbol(entry.key)} {value}{unit} ({between}): {entry.description}")
    return said


def process_table(outputs: Sequence[Mapping[str, Any]], sample_time: float) -> str:
    """Return the identified linear part of each output."""
    if not outputs:
        return ""
    rows: list[list[Cell]] = []
    for output in outputs:
        for valve, b in output["b"].items():
            delay = output["delay"].get(valve, 0)
            gain = sum(b) / (1.0 + sum(output["a"])) if 1.0 + sum(output["a"]) else float("nan")
            rows.append(
                [
                    output["name"],
                    valve,
                    ", ".join(number(v, 4) for v in output["a"]),
                    ", ".join(number(v, 4) for v in b),
                    f"{delay} ({spoken(delay * sample_time)})" if delay else "0",
                    number(gain),
                    number(output["noise_std"]),
                    number(output["fit_one_step"]),
                    number(output["fit_free_run"]),
                ]
            )
    head = ["PV", "valve", "a₁ …", "b₁ …", "delay, samples", "gain, PV units per %"]
    head += ["noise std, PV units", "fit one sample ahead, %", "fit from OP alone, %"]
    return (
        "<h2>Process identified</h2>"
        "<p>From stem χ (%) to PV y, an ARX equation: y<sub>k</sub> = "
        "−Σ a<sub>i</sub> y<sub>k−i</sub> + Σ b<sub>i</sub> χ<sub>k−i−delay</sub> + bias. Fits are "
        "100 (1 − ‖y − ŷ‖ / ‖y − mean y‖).</p>" + table(head, rows, texts=4)
    )


def responses(
    outputs: Sequence[Mapping[str, Any]], record: Record, units: Units, truth: LoopModel | None
) -> str:
    """Return a figure of each output with its responses to a step of each stem by 1 %."""
    if not outputs:
        return ""
    length = settling(outputs)
    drawn = []
    for i, output in enumerate(outputs):
        curves = [
            Curve(f"{valve} → {output['name']}", kind, step_response(output, valve, length))
            for valve, kind in zip(record.valves, itertools.cycle(COLOURS), strict=False)
        ]
        if truth is not None:
            curves += [
                Curve("simulated process", "whole", true_response(truth, i, j, length))
                for j in range(len(record.valves))
            ]
        drawn.append(
            over_time(
                f"Response of {output['name']} to a step of the stem by 1 %, from the step on.",
                np.arange(float(length)) * record.sample_time,
                curves,
                units.axis(output["name"]),
            )
        )
    return "".join(drawn)


def step_response(output: Mapping[str, Any], valve: str, samples: int) -> FloatArray:
    """Return the response, (N,), of an output of ``identify --json`` to a stem step of 1 %."""
    if valve not in output["b"]:
        return np.zeros(samples)
    delay = int(output["delay"].get(valve, 0))
    return answer_to_step(output["a"], output["b"][valve], delay, samples)


def true_response(model: LoopModel, output: int, valve: int, samples: int) -> FloatArray:
    """Return the response, shape (N,), of the true loop, linearised, to a stem step of 1 %."""
    return model.process.linear(model.sample_time).step_responses(samples)[:, output, valve]


def settling(outputs: Sequence[Mapping[str, Any]]) -> int:
    """Return after how many samples the slowest of the identified models has settled."""
    radius = max(largest_root(np.array([1.0, *output["a"]])) for output in outputs)
    if not 0.0 < radius < 1.0:
        return 100
    return int(np.clip(math.ceil(math.log(0.01) / math.log(radius)), 20, 400))


def _listed(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"Valve {names[0]}"
    return f"Valves {', '.join(names[:-1])} and {names[-1]}"
