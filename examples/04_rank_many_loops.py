"""Which valve first? Several loops, each identified, the stickiest on top.

For maintenance planners. Here the loops are simulated; put a list of files in their place.
"""

from stiction_ros import HeStiction, Identification, LoopModel, find_config, identify, simulate

FRICTION = {"FIC101": 0.0, "FIC102": 2.0, "FIC103": 6.0}  # f_S, %, true of the simulated loops


def urgency(found: Identification) -> tuple[bool, float]:
    """Return what loops are sorted by: friction first, then the share of OP in the band."""
    valve = found.valves[0]
    return valve.verdict.has_friction, valve.band_share


def main(samples: int = 1200) -> None:
    """Identify every loop and print the list."""
    model = LoopModel.load(find_config("flow.loop.yaml"))
    answers: dict[str, Identification] = {}
    for seed, (tag, static) in enumerate(FRICTION.items(), start=1):
        effects = (HeStiction(static, 0.4 * static),) if static else ()
        record = simulate(model.with_valve_effects({"V1": effects}), samples=samples, seed=seed)
        answers[tag] = identify(record)
    for tag, found in sorted(answers.items(), key=lambda item: urgency(item[1]), reverse=True):
        valve = found.valves[0]
        print(f"{tag}  {valve.verdict:10} f_S {valve.static_friction:5.2f} %", end="  ")
        print(f"band {100 * valve.band_share:3.0f} % of OP's movement")


if __name__ == "__main__":
    main()
