"""What the product answers, written down case by case: ``python -m stiction_studies.freeze``.

Each case is one small JSON file in ``test/frozen/``: verdicts, figures to six digits, named
effects, the time of the swap, the error after it. The command writes the files anew; with
``--check`` it compares them with today's answers and names the first figure of each case that
differs.
"""

import argparse
import functools
import json
import math
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

# One thread for linear algebra, as the command and the nodes have, and the same code for every
# processor that has AVX2: its last digits decide which of two optima that are alike is found.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

from stiction_ros.errors import InputError
from stiction_studies.seeds import add_jobs, run_each

Answer = dict[str, Any]

FOLDER = Path(__file__).parents[2] / "test" / "frozen"
DIGITS = 6
FIELD_SEEDS = range(50_000, 50_060)
BLIND_SEEDS = {"single": range(50_000, 50_014), "two": range(50_000, 50_006)}
WORLD_SEEDS = {"single": range(500_000, 500_014), "physics": range(500_000, 500_006)}
EXAMPLES = (
    ("example1", "measurement"),
    ("example1", "equation"),
    ("example2", "tank"),
    ("example2", "linear"),
)
EXAMPLE_SEED = 1
LIVE_SEED = 7
BAGS = ("sticky_siso", "sticky_tank", "signals_only")
REPLAYED = ("sticky_siso", "sticky_tank")

VALVE_FIGURES = (
    *("name", "verdict", "law", "band_share", "f_s", "f_s_interval", "f_d", "f_d_interval"),
    *("band_interval", "jump"),
)
OUTPUT_FIGURES = (
    "name",
    "a",
    "b",
    "delay",
    "bias",
    "noise_std",
    "fit_one_step",
    "fit_free_run",
    "cause",
)


def cases() -> dict[str, Callable[[], Answer]]:
    """Return what answers each case, by the name of its file."""
    made: dict[str, Callable[[], Answer]] = {}
    for seed in FIELD_SEEDS:
        made[f"field_{seed}"] = functools.partial(field_answer, seed)
    for family, seeds in BLIND_SEEDS.items():
        for seed in seeds:
            made[f"blind_{family}_{seed}"] = functools.partial(blind_answer, family, seed)
    for family, seeds in WORLD_SEEDS.items():
        for seed in seeds:
            made[f"world_{family}_{seed}"] = functools.partial(world_answer, family, seed)
    for name, variant in EXAMPLES:
        for method in ("evidence", "exact"):
            key = f"{name}_{variant}_{method}"
            made[key] = functools.partial(example_answer, name, variant, method)
    made["example1_measurement_grid"] = functools.partial(
        example_answer, "example1", "measurement", "grid"
    )
    for bag in BAGS:
        made[f"bag_{bag}"] = functools.partial(bag_answer, bag)
    for bag in REPLAYED:
        made[f"replay_{bag}"] = functools.partial(replay_answer, bag)
    for scenario in ("siso", "tank"):
        made[f"live_{scenario}"] = functools.partial(live_answer, scenario)
    return made


def field_answer(seed: int) -> Answer:
    """Return what ``identify`` says of one simulated loop of the field."""
    from stiction_studies.field import field_loop

    return _identified(field_loop(seed).record)


def bag_answer(name: str) -> Answer:
    """Return what ``identify`` says of one sample bag."""
    from stiction_ros import read

    return _identified(read(_bag(name)))


def replay_answer(name: str) -> Answer:
    """Return what ``replay`` says of one sample bag."""
    from stiction_ros.online.replays.run import replay

    found = replay(_bag(name))
    updates = [fit.fit.update for fit in found.fits]
    swaps = [] if found.modes is None else found.swaps
    return {
        "samples": found.samples,
        "swaps": [None if swap is None else found.seconds(swap.stamp) for swap in swaps],
        "fits": [
            None if update is None else _valves(update.identification.to_dict()["valves"])
            for update in updates
        ],
    }


def example_answer(name: str, variant: str, method: str) -> Answer:
    """Return what a method says of one of the paper's examples, with the example's orders."""
    import dataclasses

    from stiction_ros.identification import identify
    from stiction_ros.paper.methods import identify as identify_as_paper
    from stiction_ros.paper.paper_options import PaperOptions
    from stiction_studies.examples import example1, example2

    make = example1 if name == "example1" else example2
    example = make(EXAMPLE_SEED, variant)
    if method == "grid":
        printed = PaperOptions.of(example.options, method)
        return _identification(identify_as_paper(example.record, printed).to_dict())
    options = dataclasses.replace(example.options, method=method)
    return _identification(identify(example.record, options).to_dict())


def blind_answer(family: str, seed: int) -> Answer:
    """Return what ``gap --quick`` says of one loop of the package with a hidden effect."""
    from stiction_studies.blind.loops.generator import blind_loop

    seen, _ = blind_loop(seed, family)
    return _gap(seen.model, seen.record)


def world_answer(family: str, seed: int) -> Answer:
    """Return what ``gap --quick`` says of one loop with a hidden effect, by another simulator."""
    from stiction_ros.loop import LoopModel
    from stiction_studies.field.hidden import hidden_loop

    loop = hidden_loop(seed, family, "exact")
    return _gap(LoopModel.from_mapping(loop.given), loop.record)


def live_answer(name: str) -> Answer:
    """Return what a scenario comes to, run by the core without ROS."""
    from stiction_ros.cli.shared.scenarios import find
    from stiction_ros.online.session import Scenario
    from stiction_studies.commands.scenario import run_seed

    found = run_seed(Scenario.load(find(name)), LIVE_SEED, ideal_valves=False).summary
    keys = ("status", "samples", "swap_time", "delay", "period", "cycles", "phases", "valve_work")
    return {
        **{key: found[key] for key in keys},
        "valves": _valves(found["valves"]),
        "valves_latest": _valves(found["valves_latest"]),
    }


def _bag(name: str) -> Path:
    folder = Path(__file__).parents[2] / "bags" / name
    if not folder.is_dir():
        raise InputError(
            "is not there", where=str(folder), fix="use the studies from a tree of the repository"
        )
    return folder


def _identified(record: Any) -> Answer:
    """Return what ``identify`` says of the longest good part of a record, or why it refuses it."""
    from stiction_ros.identification import identify
    from stiction_ros.records.parts import longest_part

    try:
        return _identification(identify(longest_part([record])).to_dict())
    except InputError as error:
        return {"refused": str(error)}


def _identification(found: Mapping[str, Any]) -> Answer:
    return {
        "status": found["model"]["status"],
        "valves": _valves(found["valves"]),
        "outputs": [
            {key: output[key] for key in OUTPUT_FIGURES if key in output}
            for output in found["outputs"]
        ],
    }


def _valves(valves: Any) -> list[Answer]:
    frozen = []
    for valve in valves:
        evidence = valve.get("evidence") or {}
        told = {key: valve[key] for key in VALVE_FIGURES if key in valve}
        if valve.get("probability") is None:
            told["delta_bic"] = evidence.get("delta_bic")
        else:
            told |= {"probability": valve["probability"], "gain": evidence["gain"]}
        frozen.append(told)
    return frozen


def _gap(model: Any, record: Any) -> Answer:
    from stiction_ros.discrepancy import GapOptions, find_discrepancy

    found = find_discrepancy(model, [record], GapOptions(quick=True)).to_dict()
    keys = ("place", "effect", "parameters", "intervals", "delta_bic", "closed")
    return {
        "verdict": found["verdict"],
        "effects": [{key: effect[key] for key in keys} for effect in found["effects"]],
        "alternatives": [{key: each[key] for key in keys[:2]} for each in found["alternatives"]],
        "process_changes": found["process_changes"],
        "gap": found["gap"],
    }


def rounded(value: Any) -> Any:
    """Return JSON data with every number that is no integer rounded to six digits."""
    if isinstance(value, Mapping):
        return {str(key): rounded(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(entry) for entry in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS - 1}e}") if math.isfinite(value) else None
    return value


def difference(old: Any, new: Any, place: str = "") -> str | None:
    """Return where two answers differ first, as a sentence; None where they are equal."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in [*old, *(key for key in new if key not in old)]:
            if key not in old or key not in new:
                return f"{place}.{key} is in one of them alone"
            found = difference(old[key], new[key], f"{place}.{key}")
            if found:
                return found
        return None
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, pair in enumerate(zip(old, new, strict=True)):
            found = difference(*pair, f"{place}[{k}]")
            if found:
                return found
        return None
    return None if old == new else f"{place.removeprefix('.')} was {old!r} and is {new!r}"


def answer(name: str) -> tuple[str, Answer]:
    """Return the name of a case and what is answered today, as its file holds it."""
    return name, rounded(cases()[name]())


def frozen(name: str, folder: Path = FOLDER) -> Answer:
    """Return what was answered when the case was frozen.

    Raises:
        InputError: there is no such file.
    """
    path = folder / f"{name}.json"
    if not path.is_file():
        raise InputError("is not there", where=str(path), fix="write it: stiction_studies.freeze")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def main(given: list[str] | None = None) -> int:
    """Write or check the frozen cases; return 1 where one differs."""
    parser = argparse.ArgumentParser(
        prog="python -m stiction_studies.freeze",
        description="Write down what the product answers today, one small JSON file for each case.",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="cases (all), or how names begin")
    parser.add_argument("--check", action="store_true", help="compare with the files, write none")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="DIR", help=f"({FOLDER})")
    add_jobs(parser)
    options = parser.parse_args(given)
    names = [name for name in cases() if not options.names or name.startswith(tuple(options.names))]
    if options.list:
        print("\n".join(names))
        return 0
    found = run_each(answer, names, options.jobs, f"{len(names)} cases")
    if options.check:
        return _check(found, options.out)
    options.out.mkdir(parents=True, exist_ok=True)
    for name, value in found:
        text = json.dumps(value, indent=1, ensure_ascii=False) + "\n"
        (options.out / f"{name}.json").write_text(text, encoding="utf-8")
    print(f"{len(found)} cases written to {options.out}")
    return 0


def _check(found: list[tuple[str, Answer]], folder: Path) -> int:
    changed = 0
    for name, value in found:
        told = difference(frozen(name, folder), value)
        if told:
            changed += 1
            print(f"{name}: {told}")
    print(f"{len(found) - changed} of {len(found)} cases are as frozen")
    return int(changed > 0)


if __name__ == "__main__":
    sys.exit(main())
