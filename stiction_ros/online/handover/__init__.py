"""From one controller to the next: offers, the past taken over, the watch after the swap."""
