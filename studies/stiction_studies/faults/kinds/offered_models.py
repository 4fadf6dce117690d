"""Loop models that nobody should take."""

import contextlib
import math
from collections.abc import Callable, Iterator

from stiction_ros.effects.friction.he import HeStiction
from stiction_ros.loop import LoopModel
from stiction_studies.faults.fault import Fault
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.loop.setting_up import HAND_OVER
from stiction_studies.faults.terms import Pace, Phase

WATCH = 15.0  # s in which a poison is refused, or taken and rolled back
POISONS = ((60.0, 59.0), (20.0, 1.0))
TAKEN = 0.1  # by which the friction that was taken may differ
ALIASES = 9  # levels of ten: a thousand million values
KEYS = 300_000
BYTES = 20_000_000
DEPTH = 20_000


def offered(make: Callable[[], str], settle: float = 1.0) -> Callable[[RunningLoop], None]:
    """Return what offers one hostile text."""

    def put(loop: RunningLoop) -> None:
        with _answered(loop):
            loop.offer_text(make())
            loop.wait(settle)
        _take_back(loop)

    return put


def aliases() -> str:
    """Return YAML whose aliases multiply."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    for level in range(1, ALIASES):
        row = ", ".join([f"*a{level - 1}"] * 10)
        lines.append(f"a{level}: &a{level} [{row}]")
    return "\n".join(lines) + "\n"


def many_keys() -> str:
    """Return YAML with very many keys."""
    return "".join(f"key{number}: {number}\n" for number in range(KEYS))


def giant() -> str:
    """Return 20 MB in one value."""
    return f"loop: {'x' * BYTES}\n"


def deep() -> str:
    """Return lists within lists."""
    return "loop: " + "[" * DEPTH + "]" * DEPTH


def nonsense(loop: RunningLoop) -> None:
    """Offer one after another what is no loop model, or one of another loop."""
    good = loop.model.to_yaml(valid_from=loop.last("pv").stamp)
    for text in (
        "",
        "\x00\x01\x02",
        "{",
        "- 1\n- 2\n",
        "!!python/object/apply:os.system ['true']\n",
        good.replace("V1", "V9"),
        good.replace("PV1", "PV9"),
        good.replace("f_s: 5.0", "f_s: .nan"),
        good.replace("f_s: 5.0", "f_s: -5.0"),
        good.replace("f_s: 5.0", "f_s: 1.0e+300"),
        good.replace("f_s: 5.0", "f_s: text"),
        good.replace("sample_time: 1.0", "sample_time: 7.0"),
        good.split("valid_from")[0] + "valid_from: -99999999999999999999999\n",
        good.split("valid_from")[0] + "valid_from: 99999999999999999999999\n",
        good[: len(good) // 2],
    ):
        loop.offer_text(text)
        loop.wait(0.15)
    _take_back(loop)


def poison(frictions: tuple[tuple[float, float], ...], apart: float) -> Callable[..., None]:
    """Return what offers wrong frictions one after another, ``apart`` seconds."""

    def put(loop: RunningLoop) -> None:
        with _answered(loop):
            for static, dynamic in frictions:
                loop.offer(_with(loop.model, static, dynamic))
                loop.wait(apart)
            loop.wait(WATCH)
        _take_back(loop)

    return put


def swap(loop: RunningLoop) -> None:
    """Offer wrong frictions, which are refused, then the true one, which is taken."""
    loop.wait_samples(2 * HAND_OVER)
    loop.offer(_with(loop.model, *POISONS[0]))
    loop.wait(1.0)
    loop.offer(loop.model)
    if not loop.wait_until(lambda: loop.known.friction, WATCH):
        loop.remark("the true friction was not taken")
    loop.wait_samples(3 * HAND_OVER)
    known, true = loop.known.friction.get("V1.f_s", 0.0), 5.0
    if not abs(known - true) <= TAKEN * true:
        loop.remark(f"f_S is {known:.3g} after the swap, true is {true:.3g}")


def many(loop: RunningLoop) -> None:
    """Offer two hundred models within four seconds, all good."""
    for number in range(200):
        loop.offer(_with(loop.model, 5.0 + 1e-3 * number, 2.0), later=1e6)
        loop.wait(0.02)
    _take_back(loop)


def _with(model: LoopModel, static: float, dynamic: float) -> LoopModel:
    return model.with_valve_effects({"V1": [HeStiction(static, dynamic)]})


@contextlib.contextmanager
def _answered(loop: RunningLoop) -> Iterator[None]:
    """Remark it when the controller has not said a word of what was offered."""
    before = len(loop.nodes["controller"].log)
    yield
    if len(loop.nodes["controller"].log) == before:
        loop.remark("the controller has said nothing of what was offered")


def _take_back(loop: RunningLoop) -> None:
    """Leave as the latched model what a case began with."""
    if loop.phase is Phase.AFTER:
        loop.offer(loop.model)
    loop.probe.silence("loop_model")


REFUSED = "is refused in one sentence, without its text"

FAULTS = (
    Fault(
        "swap",
        "neither a refused nor a taken model makes a step late; f_S is not raised",
        swap,
        phases=(Phase.BEFORE,),
        silence=0.5,
        swaps=True,
        forgets=True,
    ),
    Fault("model-aliases", f"a model whose aliases multiply {REFUSED}", offered(aliases)),
    Fault("model-giant", f"a model of 20 MB {REFUSED}", offered(giant, 3.0)),
    Fault("model-many-keys", f"a model of 300 000 keys {REFUSED}", offered(many_keys, 2.0)),
    Fault(
        "model-deep", f"a model of 20 000 levels {REFUSED}", offered(deep), phases=(Phase.AFTER,)
    ),
    Fault(
        "model-nonsense",
        f"what is no model of this loop {REFUSED}",
        nonsense,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "model-flood",
        "two hundred models that are due later do not make a step long",
        many,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "poison-early",
        "a wrong friction that is offered before there is a past is not taken",
        poison(POISONS, 0.5),
        phases=(Phase.BEFORE,),
    ),
    Fault(
        "poison",
        "a wrong friction is refused, or taken and rolled back within the watch",
        poison(POISONS[:1], 0.0),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "poison-small",
        "a fifth of the true friction is refused, or taken and rolled back within the watch",
        poison(((1.0, 0.4),), 0.0),
        phases=(Phase.AFTER,),
    ),
    Fault(
        "poison-chain",
        "a roll-back never returns to a model that was rolled back or doubted before",
        poison((*POISONS, *POISONS), 3.0),
        (Pace.REALTIME,),
        phases=(Phase.AFTER,),
        silence=math.inf,
    ),
)
