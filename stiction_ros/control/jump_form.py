"""What a controller asks of a law of stiction: its moves between two rests, or a refusal."""

from stiction_ros.effects import Behaviour, behaviours
from stiction_ros.effects.friction.stiction import FrictionSpread, JumpForm, Stiction
from stiction_ros.errors import InputError

__all__ = ["FrictionSpread", "JumpForm", "jump_form"]


def jump_form(law: Behaviour) -> JumpForm:
    """Return the jump form of a law of stiction; InputError for a law that has none."""
    form = law.jump_form() if isinstance(law, Stiction) else None
    if form is None:
        known = [kind.law for kind in behaviours() if kind.law and _jumps(kind)]
        raise InputError(
            f"{law.title()} has no jump form, so no OP can be planned for it",
            where="friction law",
            fix=f"give the same friction by one of {', '.join(known)}",
        )
    return form


def _jumps(kind: type[Behaviour]) -> bool:
    return issubclass(kind, Stiction) and kind.jump_form is not Stiction.jump_form
