"""Who may write: a grant that is asked for, given by the plant, and lost at the first doubt."""

import dataclasses
import enum


class GrantState(enum.Enum):
    """Where the handshake stands."""

    LISTENING = "listening"  # nothing is ever written
    IDLE = "idle"  # nothing is asked for; the plant's own controller has the valves
    ASKED = "asked"  # remote operation is asked for; the mode does not grant it yet
    GRANTED = "granted"  # the mode of each valve grants it; OP is written


@dataclasses.dataclass(frozen=True)
class Grant:
    """The state of the handshake, as a value."""

    state: GrantState  # where it stands
    reason: str  # why it stands there
    wanted: bool = False  # whether it is to be asked for as soon as nothing speaks against it
    lost: bool = False  # whether it was asked for or granted before and is so no longer

    @property
    def requesting(self) -> bool:
        """Whether the request stands and the heartbeat rises."""
        return self.state in (GrantState.ASKED, GrantState.GRANTED)

    @property
    def may_write(self) -> bool:
        return self.state is GrantState.GRANTED

    def ask(self) -> "Grant":
        """Want the grant; nothing changes where nothing is ever written."""
        if self.state is not GrantState.IDLE:
            return self
        return dataclasses.replace(self, wanted=True, lost=False)

    def give_back(self, reason: str) -> "Grant":
        """Return to idle, and stay there until it is asked for again."""
        if self.state is GrantState.LISTENING:
            return self
        return Grant(GrantState.IDLE, reason, lost=self.requesting)

    def follow(self, granted: bool, fault: str = "") -> "Grant":
        """Return what becomes of it.

        - idle and wanted: asked, once nothing speaks against it.
        - asked: granted when every mode says so; idle at a fault.
        - granted: idle at a fault, or as soon as a mode says otherwise.

        A grant that was lost is not asked for again by itself: the operator may have meant it.

        Args:
            granted: whether the mode of every valve grants remote operation, by good quality.
            fault: what speaks against writing now; empty for nothing.
        """
        if self.state is GrantState.LISTENING or (not self.wanted and not self.requesting):
            return self
        if self.state is GrantState.IDLE:
            why = fault or "the mode grants what was not asked for" * granted
            if why:
                return dataclasses.replace(self, reason=f"waits: {why}")
            return Grant(GrantState.ASKED, "waits for the operator")
        if fault:
            return self.give_back(fault)
        if self.state is GrantState.ASKED and granted:
            return Grant(GrantState.GRANTED, "granted by the mode")
        if self.state is GrantState.GRANTED and not granted:
            return self.give_back("taken back by the mode")
        return self


def begin(writes: bool) -> Grant:
    """Return the grant of a node that has just begun."""
    if writes:
        return Grant(GrantState.IDLE, "not asked for")
    return Grant(GrantState.LISTENING, "writing is off")
