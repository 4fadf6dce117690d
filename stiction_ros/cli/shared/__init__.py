"""What several commands share: options, scenarios, processes, seeds, JSON, progress."""
