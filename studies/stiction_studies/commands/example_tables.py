"""What ``stiction example`` prints: one run, or many seeds."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from stiction_ros.processes import ArxProcess

if TYPE_CHECKING:
    from stiction_ros.identification import Identification
    from stiction_studies.examples import Comparison, Example, Finding
    from stiction_studies.examples.comparison import Against


def print_outcome(
    console: Console, example: "Example", comparison: "Comparison", found: "Identification"
) -> None:
    """Print true against identified of one run, the stem error and the SE."""
    title = f"{example.name}, {example.variant}, seed {example.seed}: {found.samples} samples"
    table = Table(title=title, title_justify="left")
    for name in ("", "true", "identified", "error", "95 % interval"):
        table.add_column(name, justify="left" if not name else "right")
    for valve in comparison.valves:
        table.add_row(valve.name, "", valve.verdict)
        table.add_row("  f_S %", *cells(valve.static_friction, 3))
        table.add_row("  f_D %", *cells(valve.dynamic_friction, 3))
    for channel in comparison.channels:
        name = f"{channel.valve} → {channel.output}"
        table.add_row(f"{name} delay, samples", *cells(channel.delay, 0))
        table.add_row(f"{name} DC gain per %", *cells(channel.gain, 5))
        share = f"{100 * channel.response_error:.2f} %"
        table.add_row(f"{name} step response", "", "", share)
    console.print(table)
    known = true_equations(example)
    for output in found.outputs:
        if output.name in known:
            console.print(f"{output.name}, true: {known[output.name]}")
        said = equation(output.a, output.b)
        console.print(f"{output.name}, identified: {said}")
        console.print(
            f"{output.name}: fit {output.fit_one_step:.1f} % one step, "
            f"{output.fit_free_run:.1f} % free run, noise {output.noise_std:.3g}"
        )
    console.print(
        f"stem error (1/m) Σ (χ − χ̂)²: {comparison.stem_error:.4g} %²; "
        f"SE {comparison.square_error:.6g}, with the true stems "
        f"{comparison.true_stem_square_error:.6g}"
    )
    console.print(f"{found.method}: {found.seconds:.1f} s")
    for note in found.notes:
        console.print(f"note: {note}")


def print_study(
    console: Console,
    title: str,
    rows: "Sequence[tuple[int, Comparison, Identification]]",
    findings: "Sequence[Finding]",
) -> None:
    """Print one line per seed and what the seeds say together."""
    table = Table(title=title, title_justify="left")
    for name in ("seed", "valve", "f_S %", "f_D %", "delay"):
        table.add_column(name)
    for name in ("stem error %²", "SE", "s"):
        table.add_column(name, justify="right")
    for seed, comparison, found in rows:
        columns = [
            (f"{v.name} {v.verdict}", marked(v.static_friction), marked(v.dynamic_friction))
            for v in comparison.valves
        ]
        table.add_row(
            str(seed),
            *("\n".join(column) for column in zip(*columns, strict=True)),
            " ".join(str(channel.delay.found) for channel in comparison.channels),
            f"{comparison.stem_error:.3g}",
            f"{comparison.square_error:.5g}",
            f"{found.seconds:.1f}",
        )
    console.print(table)
    console.print("* the truth lies outside the 95 % interval")
    for finding in findings:
        console.print(str(finding))


def cells(against: "Against", decimals: int) -> tuple[str, str, str, str]:
    """Return true, found, error and interval as text; * marks a truth outside its interval."""
    return (
        f"{against.true:.{decimals}f}",
        f"{against.found:.{decimals}f}",
        f"{against.error:+.{decimals}f}",
        interval(against, decimals),
    )


def interval(against: "Against", decimals: int) -> str:
    """Return the ends, with * where the truth lies outside; empty where there are none."""
    if against.interval is None:
        return ""
    low, high = against.interval
    return f"{low:.{decimals}f} … {high:.{decimals}f}{'' if against.inside else ' *'}"


def true_equations(example: "Example") -> dict[str, str]:
    """Return the true coefficients of each output where the process is an ARX equation."""
    process = example.truth.process
    if not isinstance(process, ArxProcess):
        return {}
    return {entry.name: equation(entry.a, entry.b) for entry in process.equations}


def equation(a: Sequence[float], b: Mapping[str, Sequence[float]]) -> str:
    """Return coefficients a of (8a) and b of (8b) with four digits."""
    parts = [f"a {numbers(a)}"]
    return "; ".join(parts + [f"b of {valve} {numbers(values)}" for valve, values in b.items()])


def marked(against: "Against") -> str:
    """Return what was found, with * where the truth lies outside its interval."""
    return f"{against.found:.3f}{' *' if against.inside is False else ''}"


def numbers(values: Sequence[float]) -> str:
    """Return coefficients with four digits."""
    return " ".join(f"{value:.4g}" for value in values)
