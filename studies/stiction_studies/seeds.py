"""One function over many seeds, or other items, in worker processes."""

import argparse
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TypeVar

from stiction_ros.cli.shared.progress import bar
from stiction_ros.orphans import spared

S = TypeVar("S")
T = TypeVar("T")


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """Add the option that says how many processes work."""
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), metavar="N", help="number of processes"
    )


def add_seeds(parser: argparse.ArgumentParser, first: int, last: int) -> None:
    """Add the option that says which seeds are run, unless ``first`` to ``last``."""
    said, default = f"seeds from A to B ({first}:{last})", (first, last)
    parser.add_argument("--seeds", type=seed_range, default=default, metavar="A:B", help=said)


def seed_range(text: str) -> tuple[int, int]:
    """Return ``A:B`` (or one number) as an inclusive range."""
    low, _, high = text.partition(":")
    try:
        first, last = int(low), int(high or low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no range, write A:B") from None
    if not 0 <= first <= last:
        raise argparse.ArgumentTypeError(f"{text!r} holds no seed")
    return first, last


def run_seeds(work: Callable[[int], T], seeds: tuple[int, int], jobs: int, text: str) -> list[T]:
    """Return ``work(seed)`` of every seed, in their order, with a progress bar.

    Args:
        work: a function that a worker process can be given.
        seeds: inclusive range.
        jobs: worker processes; one at least.
        text: of the bar.
    """
    wanted = range(seeds[0], seeds[1] + 1)
    return run_each(work, wanted, jobs, f"{text}: {len(wanted)} seeds")


def run_each(work: Callable[[S], T], items: Sequence[S], jobs: int, text: str) -> list[T]:
    """Return ``work(item)`` of every item, in their order, with a progress bar.

    Args:
        work: a function that a worker process can be given.
        items: of one run each.
        jobs: worker processes; one at most works in this process, which needs no start-up.
        text: of the bar.
    """
    jobs = min(jobs, len(items))
    if jobs <= 1:
        return _one_by_one(work, items, text)
    done: dict[int, T] = {}
    context = multiprocessing.get_context("spawn")
    with bar(text) as show, ProcessPoolExecutor(jobs, mp_context=context) as pool:
        with spared():  # the first item starts the workers
            futures = {pool.submit(work, item): place for place, item in enumerate(items)}
        try:
            for future in as_completed(futures):
                done[futures[future]] = future.result()
                show(len(done) / len(items))
        except BaseException:
            drop(pool)
            raise
    return [done[place] for place in range(len(items))]


def _one_by_one(work: Callable[[S], T], items: Sequence[S], text: str) -> list[T]:
    done: list[T] = []
    with bar(text) as show:
        for item in items:
            done.append(work(item))
            show(len(done) / len(items))
    return done


def drop(pool: ProcessPoolExecutor) -> None:
    """End the workers, who are spared Ctrl-C; leaving the pool would wait for what has begun."""
    for process in list((pool._processes or {}).values()):
        process.terminate()
