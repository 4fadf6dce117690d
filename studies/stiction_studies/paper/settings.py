"""The paper's settings of its two examples, and what it prints of them."""

import dataclasses
from collections.abc import Callable

from stiction_ros.errors import InputError
from stiction_ros.paper.paper_options import PaperOptions
from stiction_studies.examples import Example, example1, example2_of_one_round


@dataclasses.dataclass(frozen=True)
class PrintedExample:
    """One example of Section 4.

    Attributes:
        number: of the example.
        make: seed → record and truth.
        order: n_a = n_b.
        starts: M.
        choices: T^(m p), choices of delays.
        step: of the grid, %.
        friction: printed (f̂_S, f̂_D) per valve, %.
        delay: printed delay by the programme, samples.
        nlp_seconds, grid_seconds: printed times.
    """

    number: int
    make: Callable[[int], Example]
    order: int
    starts: int
    choices: int
    step: float
    friction: tuple[tuple[float, float], ...]
    delay: int
    nlp_seconds: float
    grid_seconds: float

    def options(self, example: Example, method: str) -> PaperOptions:
        """Return the paper's settings for a record of this example; f_max is Δu."""
        return PaperOptions.of(
            example.options,
            method,
            output_order=self.order,
            input_order=self.order,
            starts=self.starts,
            grid_step=self.step,
        )


EXAMPLES = {
    1: PrintedExample(1, example1, 3, 7, 11, 0.1, ((4.95, 2.06),), 5, 195.0, 10500.0),
    2: PrintedExample(
        2, example2_of_one_round, 5, 5, 1, 1.0, ((7.99, 1.01), (0.0, 0.0)), 0, 43.0, 6200.0
    ),
}


def printed_example(number: int) -> PrintedExample:
    """Return Example 1 or 2; InputError for any other number."""
    if number not in EXAMPLES:
        raise InputError(f"the paper has no example {number}", where="example", fix="use 1 or 2")
    return EXAMPLES[number]
