"""A linear model from an experiment, saved as a loop model for a controller.

For control engineers. The valve moves at random between two levels, in open loop.
"""

from stiction_ros import LinearOptions, LoopModel, find_config, fit_linear, prbs_experiment


def main(samples: int = 3000) -> None:
    """Make the experiment on the tank of Example 2 with ideal valves, and fit it."""
    truth = LoopModel.load(find_config("tank.loop.yaml")).with_ideal_valves()
    record = prbs_experiment(truth, samples, seed=1)
    found = fit_linear(record, LinearOptions(delay=(0, 2)))  # state space, order by BIC
    print(f"{found.status}, poles {abs(found.poles).round(3).tolist()}")
    for i, output in enumerate(found.outputs):
        gains = ", ".join(
            f"{valve} {gain:.4f}" for valve, gain in zip(found.valves, found.gain[i], strict=True)
        )
        print(f"{output}: fit {found.fit_free_run[i]:.1f} % in free run; gain per %: {gains}")
    model = found.loop_model("tank_fitted", limits=(0.0, 100.0))
    model.save("tank_fitted.loop.yaml")
    print(f"saved: {LoopModel.load('tank_fitted.loop.yaml').outputs}")


if __name__ == "__main__":
    main()
