"""A simulation disagrees with the record: which effect does it lack, where, and how large?

For control engineers. The truth has a valve with backlash; the model does not know.
"""

from stiction_ros import GapOptions, LoopModel, SetPoints, effects, find_config, find_gap, simulate


def main(samples: int = 2000) -> None:
    """Hide a backlash in the loop, and let it be named from OP and PV alone."""
    model = LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
    moves = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
    hidden = effects.from_mapping({"effect": "backlash", "band": 3.0})
    record = simulate(model.with_effect("valve:V1", hidden), moves, samples)

    found = find_gap(model, [record], GapOptions(quick=True))
    print(f"verdict: {found.verdict}")
    for effect in found.effects:
        sizes = ", ".join(f"{key} {value:.2f}" for key, value in effect.parameters.items())
        print(f"{effect.place} lacks {effect.effect}: {sizes}; ΔBIC {effect.delta_bic:.0f}")
        for place, name in effect.alternatives:
            print(f"  or {name} at {place}, which looks the same in this record")
    before, after = found.before[0].free_run_rmse, found.after[0].free_run_rmse
    print(f"free-run error {before:.3f} before, {after:.3f} with the effect in the model")
    found.model_after.save("model_after.loop.yaml")


if __name__ == "__main__":
    main()
